// Draws contents, front to back, into targets of their own: what the scene adds to each pixel, and how far away it is
// (docs/tile-format.md, section 4).
import * as THREE from 'three';
import { SceneError } from '../scene-error';
import type { ContentPart } from '../tiles/content';
import type { Content, ContentHeader } from '../tiles/decode-content';
import type { Box, TileContent, Tileset } from '../tiles/tileset';
import { frontToBack as orderOf } from './box-order';
import { contentMaterial, keyOf, programMaterial, viewUniforms, type ProgramPieces, type ProgramPlace, type ViewUniforms } from './content-program';
import { contentTarget } from './content-target';
import type { ContentTextures } from './content-textures';
import { colourOfBlock, colourOfLevel, kDisplayModes, type DisplayMode } from './display-modes';
import { hashPieces, networksOf } from './hash-program';
import { HashTextures } from './hash-textures';
import { kMostHiddenBoxes } from './hidden-boxes';
import { NetworkPass, type DrawnNetwork, type NetworkOrder } from './network-pass';
import { drawAsTheyStand, type Picture } from './picture';
import { volumePieces } from './volume-program';
import { VolumeTextures } from './volume-textures';

// A content that may be drawn.
export interface DrawnContent {
  textures: ContentTextures;
  box: Box; // scene units
  surround: boolean;
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  network?: DrawnNetwork; // of `hash`: what makes colours when all contents are drawn
  whole: boolean; // rays that end nowhere are opaque
}

// Of a content, the part in a box; all of it where there is none.
export interface DrawnPart {
  content: DrawnContent;
  within?: Box;
}

// What of a scene decides how it is drawn.
export type DrawnScene = Pick<Tileset, 'box' | 'near' | 'representation' | 'levels'>;

// One texel, so that programs need not differ where there is nothing opaque.
function farthestDepth(): THREE.DataTexture {
  const texture = new THREE.DataTexture(new Uint8Array([255]), 1, 1, THREE.RedFormat);
  texture.needsUpdate = true;
  return texture;
}

// A triangle that fills the picture.
export function screenTriangle(): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
  return geometry;
}

function bytesOfGeometry({ attributes, index }: THREE.BufferGeometry): number {
  const buffers = [...Object.values(attributes), ...(index ? [index] : [])];
  return buffers.reduce((sum, { array }) => sum + array.byteLength, 0);
}

// Puts the nearest depth where nothing of what comes next would be seen: it is not even begun there.
const kHideShader = `
uniform sampler2D colourAndOpacity;
uniform float minTransmittance;
void main() {
  if (1.0 - texelFetch(colourAndOpacity, ivec2(gl_FragCoord.xy), 0).a >= minTransmittance) discard;
  gl_FragColor = vec4(0.0);
}`;

const kContentsBetweenHiding = 4;
const kEverywhere: Box = { low: [-1e9, -1e9, -1e9], high: [1e9, 1e9, 1e9] };

export class Compositor {
  readonly view: ViewUniforms = viewUniforms();
  readonly target: THREE.WebGLRenderTarget;
  pictures: Picture[] = []; // that are in the target
  endsRays = true; // rays that end nowhere in scenes that say so are opaque
  featureLevels = 0; // of `hash`: the most fine levels of any content that has been prepared
  readonly distancesOfBytes: boolean;
  private readonly bytesPerPixel: number; // of all pictures
  private readonly depthAlone: THREE.WebGLRenderTarget; // the depth of `target`, so that its colours can be read meanwhile
  private readonly hiding = new THREE.Scene();
  private readonly contents = new THREE.Scene();
  private readonly cube = new THREE.BoxGeometry(1, 1, 1);
  private readonly screen = screenTriangle();
  private readonly anyCamera = new THREE.Camera();
  private readonly nothingOpaque = farthestDepth();
  private readonly weightTargets: number; // beyond the first
  private readonly networks?: NetworkPass; // of `hash`
  private cuts = false; // from the first hidden box on, so that programs are not made anew for each
  private readonly prepared = new Map<string, THREE.Material>(); // hold programs, by their keys

  // Throws SceneError where the card cannot draw such a scene.
  constructor(renderer: THREE.WebGLRenderer, scene: DrawnScene) {
    const { target, distancesOfBytes, weightTargets, bytesPerPixel } = contentTarget(renderer, scene);
    this.target = target;
    this.distancesOfBytes = distancesOfBytes;
    this.weightTargets = weightTargets;
    this.bytesPerPixel = bytesPerPixel;
    this.depthAlone = new THREE.WebGLRenderTarget(1, 1, {
      generateMipmaps: false, depthBuffer: true, depthTexture: target.depthTexture, format: THREE.RedFormat,
    });
    this.hiding.add(new THREE.Mesh(this.screen, new THREE.ShaderMaterial({
      vertexShader: 'void main() { gl_Position = vec4(position.xy, -1.0, 1.0); }',
      fragmentShader: kHideShader,
      uniforms: {
        colourAndOpacity: { value: this.target.textures[0] }, minTransmittance: this.view.minTransmittance,
      },
      depthFunc: THREE.AlwaysDepth, colorWrite: false,
    })));
    this.hiding.children[0].frustumCulled = false;
    if (scene.representation === 'hash') this.networks = new NetworkPass(this.target, this.screen, this.view, this.weightTargets);
    this.contents.matrixWorldAutoUpdate = false;
    this.view.sceneLow.value.set(...scene.box.low);
    this.view.sceneHigh.value.set(...scene.box.high);
    this.view.sceneNear.value = scene.near;
  }

  // What the scene adds to each pixel, with its opacity.
  get colour(): THREE.Texture {
    return (this.networks?.target ?? this.target).textures[0];
  }

  // Has the driver begin with the programs of such a content, beside other work.
  prepare(renderer: THREE.WebGLRenderer, header: ContentHeader, surround: boolean, ownProgram: boolean): void {
    if (header.representation === 'hash') {
      this.featureLevels = Math.max(this.featureLevels, header.parts[0].tables.length);
      renderer.compile(this.networks!.networkOf(header.network).mesh, this.anyCamera);
    }
    const pieces = this.piecesOf(header, ownProgram);
    const place = this.placeOf(header.parts, surround);
    const key = keyOf(pieces, place);
    if (this.prepared.has(key)) return;
    const material = programMaterial(pieces, place);
    this.prepared.set(key, material);
    renderer.compile(new THREE.Mesh(this.screen, material), this.anyCamera);
  }

  // `number` and `level` are the tile's, for display modes; `ownProgram` is for what is drawn for long.
  make(
    content: Content, { box, surround }: Pick<TileContent, 'box' | 'surround'>, number: number, level: number, ownProgram: boolean,
  ): DrawnContent {
    const place = this.placeOf(content.parts, surround);
    const isHash = content.representation === 'hash';
    const textures = isHash ? new HashTextures(content) : new VolumeTextures(content);
    const colours = { block: colourOfBlock(number), level: colourOfLevel(level) };
    const material = contentMaterial(textures, this.view, this.piecesOf(content, ownProgram), place, colours);
    const mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>(
      place.everywhere ? this.screen : this.cube, material);
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = mesh.matrixWorldAutoUpdate = false;
    if (!isHash) return { textures, box, surround, mesh, whole: false };
    material.uniforms.network = { value: 0 };
    const network = this.networks!.networkOf(content.network);
    ++network.contents;
    return { textures, box, surround, mesh, network, whole: content.settings.whole };
  }

  compile(renderer: THREE.WebGLRenderer, { mesh, network }: DrawnContent): void {
    renderer.compile(mesh, this.anyCamera);
    if (network) renderer.compile(network.mesh, this.anyCamera);
  }

  isCompiled(renderer: THREE.WebGLRenderer, { mesh, network }: DrawnContent): boolean {
    const isReady = (material: THREE.Material) => {
      const { currentProgram } = renderer.properties.get(material) as { currentProgram?: { isReady(): boolean } };
      return currentProgram?.isReady() ?? true;
    };
    return isReady(mesh.material) && (!network || isReady(network.mesh.material));
  }

  remove(content: DrawnContent): void {
    content.mesh.material.uniformsGroups.forEach((group) => group.dispose());
    content.mesh.material.dispose();
    content.textures.dispose();
    if (content.network) this.networks!.release(content.network);
  }

  // Of the card, without contents.
  get bytes(): number {
    const pixels = this.target.width * this.target.height;
    return (this.bytesPerPixel + 4 + 1) * pixels + (this.networks?.bytes ?? 0) + bytesOfGeometry(this.cube) + bytesOfGeometry(this.screen) + 4;
  }

  resize({ x, y }: THREE.Vector2): void {
    if (this.target.width !== x || this.target.height !== y) {
      this.target.setSize(x, y);
      this.depthAlone.setSize(x, y);
      this.networks?.resize(x, y);
    }
    this.view.resolution.value.set(x, y);
  }

  // `level` of features, 0 the coarse ones, where the mode shows one.
  show(mode: DisplayMode, level: number): void {
    const { display, shares, attention } = this.view;
    display.value = kDisplayModes.indexOf(mode);
    shares.value.forEach((_, l) => (shares.value[l] = mode === 'contribution' && l !== level ? 0 : 1));
    const fine = Math.max(level, 1); // nothing weighs the coarse ones
    attention.value = mode === 'attention' ? 2 * fine : mode === 'densityAttention' ? 2 * fine - 1 : 0;
  }

  // Boxes in which nothing is drawn, and such in which nothing of the surround is: from the cube of edge 1 about the
  // origin to the scene. `withinBox`: nor is anything outside of the scene's box. Throws SceneError where they are too
  // many; those without a volume hide nothing.
  hide(boxes: readonly THREE.Matrix4[], ofSurround: readonly THREE.Matrix4[], withinBox: boolean): void {
    if (boxes.length > kMostHiddenBoxes) {
      throw new SceneError('scene', 'hidden', `are ${boxes.length} boxes, and ${kMostHiddenBoxes} can be hidden`, 'hide fewer, larger ones');
    }
    const { boxFromScene, hiddenBoxes, hiddenBoxesOfSurround } = this.view;
    const whole = (box: THREE.Matrix4) => box.determinant() !== 0;
    const all = [...boxes.filter(whole), ...ofSurround.filter(whole).slice(0, kMostHiddenBoxes)];
    all.forEach((box, n) => boxFromScene.value[n].copy(box).invert());
    hiddenBoxes.value = boxes.filter(whole).length;
    hiddenBoxesOfSurround.value = all.length;
    this.view.withinBox.value = withinBox;
    this.cuts ||= all.length > 0 || withinBox;
  }

  // `worldFromScene`: of three's world; contents of each picture, front to back. Draws into `target`; rays end at the depth
  // of what is opaque, if that is given.
  draw(
    renderer: THREE.WebGLRenderer, pictures: Picture[], worldFromScene: THREE.Matrix4, contents: DrawnPart[][],
    opaqueDepth: THREE.Texture | null, ofNothing?: DrawnContent,
  ): void {
    this.pictures = pictures;
    this.view.opaqueDepth.value = opaqueDepth ?? this.nothingOpaque;
    for (const { mesh: { material } } of new Set(contents.flat().map(({ content }) => content))) {
      if (!this.cuts || 'CUTS' in material.defines) continue;
      material.defines.CUTS = '';
      material.needsUpdate = true;
    }
    const before = renderer.getRenderTarget();
    const autoClear = renderer.autoClear;
    const clearColour = renderer.getClearColor(new THREE.Color());
    const clearAlpha = renderer.getClearAlpha();
    renderer.setClearColor(0, 0);
    renderer.autoClear = false;
    for (const target of [this.target, ...(this.networks ? [this.networks.target] : [])]) {
      renderer.setRenderTarget(target);
      renderer.clear();
    }
    drawAsTheyStand(renderer, pictures, () =>
      pictures.forEach((picture, i) => this.drawOne(renderer, picture, worldFromScene, contents[i], ofNothing)));
    renderer.autoClear = autoClear;
    renderer.setClearColor(clearColour, clearAlpha);
    renderer.setRenderTarget(before);
  }

  // Where the surface is in a picture, scene units; `at` runs from -1 to 1 across it, upwards.
  surfaceAt(renderer: THREE.WebGLRenderer, { part, origin, ray }: Picture, at: THREE.Vector2): THREE.Vector3 | undefined {
    const pixel = (x: number, size: number) => Math.min(Math.max(Math.floor((0.5 + 0.5 * x) * size), 0), size - 1);
    const { type } = this.target.textures[1];
    const read = type === THREE.FloatType ? new Float32Array(4) : type === THREE.HalfFloatType ? new Uint16Array(4) : new Uint8Array(4);
    renderer.readRenderTargetPixels(this.target, part.x + pixel(at.x, part.z), part.y + pixel(at.y, part.w), 1, 1, read, undefined, 1);
    const [value, , , hides] = [...read].map(
      (x) => (type === THREE.FloatType ? x : type === THREE.HalfFloatType ? THREE.DataUtils.fromHalfFloat(x) : x / 255));
    if (hides <= 0.99) return undefined;
    const distance = this.distancesOfBytes ? value / hides / Math.max(1 - value / hides, 1e-3) : value / hides;
    const inPicture = new THREE.Vector3(at.x, at.y, 1);
    const direction = inPicture.clone().applyMatrix3(ray).normalize();
    return inPicture.applyMatrix3(origin).addScaledVector(direction, distance);
  }

  dispose(): void {
    this.target.depthTexture?.dispose();
    this.target.dispose();
    this.depthAlone.dispose();
    this.networks?.dispose();
    (this.hiding.children[0] as THREE.Mesh<THREE.BufferGeometry, THREE.Material>).material.dispose();
    this.cube.dispose();
    this.screen.dispose();
    this.nothingOpaque.dispose();
    for (const material of this.prepared.values()) material.dispose();
    this.prepared.clear();
  }

  private piecesOf(content: ContentHeader | Content, ownProgram: boolean): ProgramPieces {
    return content.representation === 'hash' ? hashPieces(content, this.weightTargets) : volumePieces(content, ownProgram);
  }

  private placeOf(parts: ContentPart[], surround: boolean): ProgramPlace {
    // What is contracted may own what lies beyond any box.
    const everywhere = surround || parts.some((part) => part.contracted);
    return { surround, everywhere, distancesOfBytes: this.distancesOfBytes, cuts: this.cuts };
  }

  // Which number each network has in a picture. More than can be told apart are taken for the last.
  private networksOf(frontToBack: DrawnPart[], ofNothing?: DrawnContent): NetworkOrder {
    const whole = this.endsRays && ofNothing?.whole === true;
    const found = new Set([...(whole ? [ofNothing] : []), ...frontToBack.map(({ content }) => content)].map(({ network }) => network!));
    const networks = [...found].slice(0, networksOf(this.weightTargets));
    const numberOf = ({ network }: DrawnContent) => (networks.includes(network!) ? networks.indexOf(network!) : networks.length - 1);
    for (const { content } of frontToBack) content.mesh.material.uniforms.network.value = numberOf(content);
    return { networks, whole, behind: whole ? numberOf(ofNothing) : 0 };
  }

  private place({ mesh, box }: DrawnContent, within: Box, worldFromScene: THREE.Matrix4): void {
    const low = new THREE.Vector3(...box.low).max(this.view.withinLow.value.set(...within.low));
    const high = new THREE.Vector3(...box.high).min(this.view.withinHigh.value.set(...within.high));
    const middle = low.clone().add(high).multiplyScalar(0.5);
    mesh.matrixWorld.makeScale(high.x - low.x, high.y - low.y, high.z - low.z).setPosition(middle).premultiply(worldFromScene);
  }

  private drawOne(
    renderer: THREE.WebGLRenderer, picture: Picture, worldFromScene: THREE.Matrix4, frontToBack: DrawnPart[], ofNothing?: DrawnContent,
  ): void {
    const { camera, part, eye, origin, ray, sceneFromClip } = picture;
    this.view.part.value = part;
    this.view.origin.value = origin;
    this.view.ray.value = ray;
    this.view.sceneFromClip.value = sceneFromClip;
    for (const { textures } of new Set(frontToBack.map(({ content }) => content))) {
      if (textures.parts.length > 1) textures.orderParts(orderOf(textures.parts, eye));
    }
    this.target.viewport.copy(part);
    this.depthAlone.viewport.copy(part);
    renderer.setRenderTarget(this.target);
    const networks = this.networks && this.networksOf(frontToBack, ofNothing);
    const hides = this.view.minTransmittance.value > 0;
    frontToBack.forEach(({ content, within = kEverywhere }, i) => {
      if (hides && i > 0 && (content.surround || i % kContentsBetweenHiding === 0)) {
        renderer.setRenderTarget(this.depthAlone);
        renderer.render(this.hiding, camera);
        renderer.setRenderTarget(this.target);
      }
      this.place(content, within, worldFromScene);
      this.contents.children = [content.mesh];
      renderer.render(this.contents, camera);
    });
    this.contents.children = [];
    if (networks) this.networks!.draw(renderer, picture, networks);
  }
}
