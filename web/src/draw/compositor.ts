// Draws contents, front to back, into targets of their own: what the scene adds to each pixel, and how far away it is
// (docs/tile-format.md, section 4).
import * as THREE from 'three';
import type { Box, TileContent } from '../tiles/tileset';
import type { VolumeHeader } from '../tiles/decode-volume';
import type { VolumePart } from '../tiles/volume-content';
import { frontToBack as orderOf } from './box-order';
import { colourOfBlock, colourOfLevel } from './display-modes';
import { kMostHiddenBoxes } from './hidden-boxes';
import { packNetwork } from './network-shader';
import { drawAsTheyStand, type Picture } from './picture';
import { programMaterial, volumeMaterial, viewUniforms, type ProgramShape, type ViewUniforms } from './volume-material';
import { SceneError } from '../scene-error';
import { atlasesOf, type ContentTextures } from './content-textures';

// A content that may be drawn.
export interface DrawnContent {
  textures: ContentTextures;
  box: Box; // scene units
  surround: boolean;
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
}

// Of a content, the part in a box; all of it where there is none.
export interface DrawnPart {
  content: DrawnContent;
  within?: Box;
}

export interface ScenePlace {
  box: Box; // of the scene
  near: number;
}

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
  readonly target: THREE.WebGLRenderTarget; // what the scene adds, with its opacity; how far its surface is
  pictures: Picture[] = []; // that are in the target
  readonly distancesOfBytes: boolean;
  private readonly bytesPerPixel: number; // of both pictures
  private readonly depthAlone: THREE.WebGLRenderTarget; // the depth of `target`, so that its colours can be read meanwhile
  private readonly hiding = new THREE.Scene();
  private readonly contents = new THREE.Scene();
  private readonly cube = new THREE.BoxGeometry(1, 1, 1);
  private readonly screen = screenTriangle();
  private readonly anyCamera = new THREE.Camera();
  private readonly nothingOpaque = farthestDepth();
  private cuts = false; // from the first hidden box on, so that programs are not made anew for each
  private readonly prepared = new Map<string, THREE.Material>(); // hold programs, by their shape

  // What the card can blend decides how the pictures are kept.
  constructor(renderer: THREE.WebGLRenderer, place: ScenePlace) {
    const has = (name: string) => renderer.extensions.has(name);
    const canBlendHalves = has('EXT_color_buffer_half_float') || has('EXT_color_buffer_float');
    this.distancesOfBytes = !canBlendHalves;
    this.bytesPerPixel = canBlendHalves ? 16 : 8;
    const depthTexture = new THREE.DepthTexture(1, 1, THREE.UnsignedIntType);
    const common = { generateMipmaps: false, depthBuffer: true, depthTexture };
    this.target = new THREE.WebGLRenderTarget(1, 1, {
      ...common, count: 2, type: canBlendHalves ? THREE.HalfFloatType : THREE.UnsignedByteType,
      minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter,
    });
    this.depthAlone = new THREE.WebGLRenderTarget(1, 1, { ...common, format: THREE.RedFormat });
    this.hiding.add(new THREE.Mesh(this.screen, new THREE.ShaderMaterial({
      vertexShader: 'void main() { gl_Position = vec4(position.xy, -1.0, 1.0); }',
      fragmentShader: kHideShader,
      uniforms: {
        colourAndOpacity: { value: this.target.textures[0] }, minTransmittance: this.view.minTransmittance,
      },
      depthFunc: THREE.AlwaysDepth, colorWrite: false,
    })));
    this.hiding.children[0].frustumCulled = false;
    this.target.textures[1].minFilter = this.target.textures[1].magFilter = THREE.NearestFilter;
    // Half floats tell distances apart by a two-thousandth: places that are measured want more.
    if (has('EXT_color_buffer_float') && has('EXT_float_blend')) {
      this.target.textures[1].type = THREE.FloatType;
      this.bytesPerPixel = 8 + 16;
    }
    this.contents.matrixWorldAutoUpdate = false;
    this.view.sceneLow.value.set(...place.box.low);
    this.view.sceneHigh.value.set(...place.box.high);
    this.view.sceneNear.value = place.near;
  }

  // Has the driver begin with the program of such a content, beside other work.
  prepare(
    renderer: THREE.WebGLRenderer, { parts, network, layout: { voxels, atlasDepth } }: Pick<VolumeHeader, 'parts' | 'network' | 'layout'>,
    surround: boolean, ownProgram: boolean,
  ): void {
    const widths = network.map((layer) => layer.outputs);
    const atlases = atlasesOf(voxels[2], atlasDepth);
    const shape = this.shapeOf({ parts, widths, atlases, network: ownProgram ? packNetwork(network) : undefined }, surround);
    const key = JSON.stringify({ ...shape, network: shape.network && [...shape.network] });
    if (this.prepared.has(key)) return;
    const material = programMaterial(shape);
    this.prepared.set(key, material);
    renderer.compile(new THREE.Mesh(this.screen, material), this.anyCamera);
  }

  // `number` and `level` are the tile's, for display modes; `ownProgram` is for what is drawn for long.
  make(
    textures: ContentTextures, { box, surround }: Pick<TileContent, 'box' | 'surround'>, number: number, level: number, ownProgram: boolean,
  ): DrawnContent {
    const { parts, widths, voxelsFirst, network } = textures;
    const shape = this.shapeOf(
      { parts, widths, atlases: voxelsFirst.length, network: ownProgram ? network : undefined }, surround);
    const material = volumeMaterial(textures, this.view, shape, { block: colourOfBlock(number), level: colourOfLevel(level) });
    const mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>(
      shape.everywhere ? this.screen : this.cube, material);
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = mesh.matrixWorldAutoUpdate = false;
    return { textures, box, surround, mesh };
  }

  compile(renderer: THREE.WebGLRenderer, { mesh }: DrawnContent): void {
    renderer.compile(mesh, this.anyCamera);
  }

  isCompiled(renderer: THREE.WebGLRenderer, { mesh }: DrawnContent): boolean {
    const { currentProgram } = renderer.properties.get(mesh.material) as { currentProgram?: { isReady(): boolean } };
    return currentProgram?.isReady() ?? true;
  }

  remove(content: DrawnContent): void {
    content.mesh.material.uniformsGroups.forEach((group) => group.dispose());
    content.mesh.material.dispose();
    content.textures.dispose();
  }

  // Of the card, without contents.
  get bytes(): number {
    const pixels = this.target.width * this.target.height;
    return (this.bytesPerPixel + 4 + 1) * pixels + bytesOfGeometry(this.cube) + bytesOfGeometry(this.screen) + 4;
  }

  resize({ x, y }: THREE.Vector2): void {
    if (this.target.width !== x || this.target.height !== y) {
      this.target.setSize(x, y);
      this.depthAlone.setSize(x, y);
    }
    this.view.resolution.value.set(x, y);
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
    opaqueDepth: THREE.Texture | null,
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
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0, 0);
    renderer.autoClear = false;
    renderer.clear();
    drawAsTheyStand(renderer, pictures, () =>
      pictures.forEach((picture, i) => this.drawOne(renderer, picture, worldFromScene, contents[i])));
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
    (this.hiding.children[0] as THREE.Mesh<THREE.BufferGeometry, THREE.Material>).material.dispose();
    this.cube.dispose();
    this.screen.dispose();
    this.nothingOpaque.dispose();
    for (const material of this.prepared.values()) material.dispose();
    this.prepared.clear();
  }

  private shapeOf(
    { parts, widths, atlases, network }: Pick<ProgramShape, 'widths' | 'atlases' | 'network'> & { parts: VolumePart[] }, surround: boolean,
  ): ProgramShape {
    // What is contracted may own what lies beyond any box.
    const everywhere = surround || parts.some((part) => part.contracted);
    return {
      parts: parts.length, atlases, widths, surround, everywhere, distancesOfBytes: this.distancesOfBytes, cuts: this.cuts,
      network: network?.every(Number.isFinite) ? network : undefined,
    };
  }

  private place({ mesh, box }: DrawnContent, within: Box, worldFromScene: THREE.Matrix4): void {
    const low = new THREE.Vector3(...box.low).max(this.view.withinLow.value.set(...within.low));
    const high = new THREE.Vector3(...box.high).min(this.view.withinHigh.value.set(...within.high));
    const middle = low.clone().add(high).multiplyScalar(0.5);
    mesh.matrixWorld.makeScale(high.x - low.x, high.y - low.y, high.z - low.z).setPosition(middle).premultiply(worldFromScene);
  }

  private drawOne(
    renderer: THREE.WebGLRenderer, { camera, part, eye, origin, ray, sceneFromClip }: Picture, worldFromScene: THREE.Matrix4,
    frontToBack: DrawnPart[],
  ): void {
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
  }
}
