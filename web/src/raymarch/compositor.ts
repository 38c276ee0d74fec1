// Renders contents front to back into its own render targets: the premultiplied colour of the scene, and its distance
// (docs/tile-format.md, section 4).
import * as THREE from 'three';
import { colourOfBlock, colourOfLevel, type ShownMode } from '../draw/display-modes';
import { contentTarget } from '../draw/content-target';
import { selectHiddenBoxes } from '../draw/hidden-boxes';
import { farthestDepth } from '../draw/opaque-depth';
import { drawIntoTargets } from '../draw/own-targets';
import type { Picture } from '../draw/picture';
import { readSurface } from '../draw/read-surface';
import type { ContentPlace, DrawnPart, DrawnScene, DrawSettings, SceneDrawer, SceneView } from '../draw/scene-drawer';
import { screenTriangle } from '../draw/screen-triangle';
import type { Box } from '../tiles/tileset';
import { frontToBack as sortFrontToBack } from './box-order';
import type { ContentPart, MarchedContent, MarchedHeader } from './content';
import { contentMaterial, programKey, programMaterial, viewUniforms, type ProgramPlace, type ViewUniforms } from './content-program';
import type { ContentTextures } from './content-textures';
import type { MarchedOwn, Marching, MarchMethod } from './marching';

// A content that can be drawn.
export interface MarchedDrawnContent<Own extends MarchedOwn = MarchedOwn> {
  textures: ContentTextures;
  box: Box; // scene units
  backgroundBlock: boolean;
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  own: Own;
}

function bytesOfGeometry({ attributes, index }: THREE.BufferGeometry): number {
  const buffers = [...Object.values(attributes), ...(index ? [index] : [])];
  return buffers.reduce((sum, { array }) => sum + array.byteLength, 0);
}

// Writes the nearest depth where the next contents would be invisible, so that the depth test skips their fragments.
const kHideShader = `
uniform sampler2D colourAndOpacity;
uniform float minTransmittance;
void main() {
  if (1.0 - texelFetch(colourAndOpacity, ivec2(gl_FragCoord.xy), 0).a >= minTransmittance) discard;
  gl_FragColor = vec4(0.0);
}`;

const kContentsBetweenHiding = 4;
const kEverywhere: Box = { low: [-1e9, -1e9, -1e9], high: [1e9, 1e9, 1e9] };

export class Compositor<Header extends MarchedHeader, Decoded extends MarchedContent, Own extends MarchedOwn>
  implements SceneDrawer<Header, Decoded, MarchedDrawnContent<Own>> {
  readonly view: ViewUniforms = viewUniforms();
  readonly target: THREE.WebGLRenderTarget;
  pictures: Picture[] = []; // the pictures in the target
  readonly distancesOfBytes: boolean;
  private readonly modes: readonly ShownMode[];
  private readonly bytesOfContents: number; // of a pixel
  // Shares the depth of `target`, so that the colours of `target` can be read at the same time.
  private readonly depthAlone: THREE.WebGLRenderTarget;
  private readonly hiding = new THREE.Scene();
  private readonly contents = new THREE.Scene();
  private readonly cube = new THREE.BoxGeometry(1, 1, 1);
  private readonly screen = screenTriangle();
  private readonly anyCamera = new THREE.Camera();
  private readonly nothingOpaque = farthestDepth();
  private readonly marching: Marching<Header, Decoded, Own>;
  private cuts = false; // set with the first hidden box and never cleared, so that programs are compiled again only once
  private readonly prepared = new Map<string, THREE.Material>(); // keeps programs alive, by their keys

  // Throws SceneError if the GPU cannot draw such a scene.
  constructor(private readonly renderer: THREE.WebGLRenderer, scene: DrawnScene, method: MarchMethod<Header, Decoded, Own>) {
    const output = contentTarget(renderer, method.target(scene.levels));
    this.target = output.target;
    this.distancesOfBytes = output.distancesOfBytes;
    this.bytesOfContents = output.bytesPerPixel;
    this.modes = method.modes;
    this.depthAlone = new THREE.WebGLRenderTarget(1, 1, {
      generateMipmaps: false, depthBuffer: true, depthTexture: output.target.depthTexture, format: THREE.RedFormat,
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
    this.marching = method.make(output, this.screen, this.view);
    this.contents.matrixWorldAutoUpdate = false;
    this.view.sceneLow.value.set(...scene.box.low);
    this.view.sceneHigh.value.set(...scene.box.high);
    this.view.sceneNear.value = scene.near;
  }

  get colour(): THREE.Texture {
    return (this.marching.lastPass?.target ?? this.target).textures[0];
  }

  get distance(): THREE.Texture {
    return this.target.textures[1];
  }

  get featureLevels(): number {
    return this.marching.featureLevels;
  }

  // Returns the bytes of the textures and of the uniform block of the program.
  residentBytes(header: Header): number {
    return header.memoryBytes + 16 * this.marching.vectors(header);
  }

  prepare(header: Header, { backgroundBlock, isDrawnForLong }: ContentPlace): void {
    for (const mesh of this.marching.prepare?.(header) ?? []) this.renderer.compile(mesh, this.anyCamera);
    const pieces = this.marching.pieces(header, isDrawnForLong);
    const place = this.programPlace(header.parts, backgroundBlock);
    const key = programKey(pieces, place);
    if (this.prepared.has(key)) return;
    const material = programMaterial(pieces, place);
    this.prepared.set(key, material);
    this.renderer.compile(new THREE.Mesh(this.screen, material), this.anyCamera);
  }

  allocate(content: Decoded, { box, backgroundBlock, number, level, isDrawnForLong }: ContentPlace): MarchedDrawnContent<Own> {
    const place = this.programPlace(content.parts, backgroundBlock);
    const textures = this.marching.textures(content);
    const own = this.marching.own(content);
    const material = contentMaterial(textures, this.view, this.marching.pieces(content, isDrawnForLong), place);
    Object.assign(material.uniforms, {
      ...this.marching.uniforms, ...own.uniforms,
      colourOfBlock: { value: colourOfBlock(number) }, colourOfLevel: { value: colourOfLevel(level) },
    });
    const mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>(
      place.everywhere ? this.screen : this.cube, material);
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = mesh.matrixWorldAutoUpdate = false;
    for (const one of [mesh, ...own.meshes]) this.renderer.compile(one, this.anyCamera);
    return { textures, box, backgroundBlock, mesh, own };
  }

  upload(content: MarchedDrawnContent<Own>): 'more' | 'wait' | 'done' {
    if (!content.textures.upload(this.renderer)) return 'more';
    return this.isCompiled(content) ? 'done' : 'wait';
  }

  free({ mesh, textures, own }: MarchedDrawnContent<Own>): void {
    mesh.material.uniformsGroups.forEach((group) => group.dispose());
    mesh.material.dispose();
    textures.dispose();
    this.marching.release?.(own);
  }

  get bytesPerPixel(): number {
    return this.bytesOfContents + 4 + 1 + (this.marching.lastPass?.bytesPerPixel ?? 0);
  }

  get bytes(): number {
    const pixels = this.target.width * this.target.height;
    return this.bytesPerPixel * pixels + bytesOfGeometry(this.cube) + bytesOfGeometry(this.screen) + 4;
  }

  resize({ x, y }: THREE.Vector2): void {
    if (this.target.width !== x || this.target.height !== y) {
      this.target.setSize(x, y);
      this.depthAlone.setSize(x, y);
      this.marching.lastPass?.resize(x, y);
    }
    this.view.resolution.value.set(x, y);
  }

  draw({ pictures, worldFromScene, contents, opaqueDepth, backgroundContent }: SceneView<MarchedDrawnContent<Own>>, settings: DrawSettings): boolean {
    const { renderer } = this;
    this.set(settings);
    this.pictures = pictures;
    this.view.opaqueDepth.value = opaqueDepth ?? this.nothingOpaque;
    for (const { mesh: { material } } of new Set(contents.flat().map(({ content }) => content))) {
      if (!this.cuts || 'CUTS' in material.defines) continue;
      material.defines.CUTS = '';
      material.needsUpdate = true;
    }
    const opaque = settings.endsRays && backgroundContent?.own.hasLearnedBackground ? backgroundContent.own : undefined;
    drawIntoTargets(renderer, pictures, () => {
      for (const target of [this.target, ...(this.marching.lastPass ? [this.marching.lastPass.target] : [])]) {
        renderer.setRenderTarget(target);
        renderer.clear();
      }
      pictures.forEach((picture, i) => this.drawOne(picture, worldFromScene, contents[i], opaque));
    });
    return backgroundContent?.own.hasLearnedBackground || contents.some((ofOne) => ofOne.length > 0);
  }

  wantsAnotherFrame(): boolean {
    return false;
  }

  surfaceAt(renderer: THREE.WebGLRenderer, picture: Picture, at: THREE.Vector2): THREE.Vector3 | undefined {
    return readSurface(renderer, this, picture, at);
  }

  dispose(): void {
    this.target.depthTexture?.dispose();
    this.target.dispose();
    this.depthAlone.dispose();
    this.marching.lastPass?.dispose();
    (this.hiding.children[0] as THREE.Mesh<THREE.BufferGeometry, THREE.Material>).material.dispose();
    this.cube.dispose();
    this.screen.dispose();
    this.nothingOpaque.dispose();
    for (const material of this.prepared.values()) material.dispose();
    this.prepared.clear();
  }

  private set({ display, featureLevel, minTransmittance, visibility, hidden, hiddenOfBackgroundBlock, withinBox }: DrawSettings): void {
    this.view.minTransmittance.value = minTransmittance;
    this.view.visibility.value = visibility;
    this.view.display.value = this.modes.findIndex(({ name }) => name === display);
    this.marching.show?.(display, featureLevel);
    this.hide(hidden, hiddenOfBackgroundBlock, withinBox);
  }

  private hide(boxes: readonly THREE.Matrix4[], ofBackgroundBlock: readonly THREE.Matrix4[], withinBox: boolean): void {
    const { boxFromScene, hiddenBoxes, hiddenBoxesOfBackgroundBlock } = this.view;
    const { all, ofAllContents } = selectHiddenBoxes(boxes, ofBackgroundBlock);
    all.forEach((box, n) => boxFromScene.value[n].copy(box).invert());
    hiddenBoxes.value = ofAllContents;
    hiddenBoxesOfBackgroundBlock.value = all.length;
    this.view.withinBox.value = withinBox;
    this.cuts ||= all.length > 0 || withinBox;
  }

  private isCompiled({ mesh, own }: MarchedDrawnContent<Own>): boolean {
    return [mesh, ...own.meshes].every(({ material }) => {
      const { currentProgram } = this.renderer.properties.get(material) as { currentProgram?: { isReady(): boolean } };
      return currentProgram?.isReady() ?? true;
    });
  }

  private programPlace(parts: ContentPart[], backgroundBlock: boolean): ProgramPlace {
    // A contracted part may own space beyond any box.
    const everywhere = backgroundBlock || parts.some((part) => part.contracted);
    return { backgroundBlock, everywhere, distancesOfBytes: this.distancesOfBytes, cuts: this.cuts };
  }

  private place({ mesh, box }: MarchedDrawnContent<Own>, within: Box, worldFromScene: THREE.Matrix4): void {
    const low = new THREE.Vector3(...box.low).max(this.view.withinLow.value.set(...within.low));
    const high = new THREE.Vector3(...box.high).min(this.view.withinHigh.value.set(...within.high));
    const middle = low.clone().add(high).multiplyScalar(0.5);
    mesh.matrixWorld.makeScale(high.x - low.x, high.y - low.y, high.z - low.z).setPosition(middle).premultiply(worldFromScene);
  }

  private drawOne(
    picture: Picture, worldFromScene: THREE.Matrix4, frontToBack: DrawnPart<MarchedDrawnContent<Own>>[], backgroundContent?: Own,
  ): void {
    const { renderer } = this;
    const { camera, part, eye, origin, ray, sceneFromClip } = picture;
    this.view.part.value = part;
    this.view.origin.value = origin;
    this.view.ray.value = ray;
    this.view.sceneFromClip.value = sceneFromClip;
    for (const { textures } of new Set(frontToBack.map(({ content }) => content))) {
      if (textures.parts.length > 1) textures.orderParts(sortFrontToBack(textures.parts, eye));
    }
    this.target.viewport.copy(part);
    this.depthAlone.viewport.copy(part);
    renderer.setRenderTarget(this.target);
    const end = this.marching.begin?.(frontToBack.map(({ content }) => content.own), backgroundContent);
    const hides = this.view.minTransmittance.value > 0;
    frontToBack.forEach(({ content, within = kEverywhere }, i) => {
      if (hides && i > 0 && (content.backgroundBlock || i % kContentsBetweenHiding === 0)) {
        renderer.setRenderTarget(this.depthAlone);
        renderer.render(this.hiding, camera);
        renderer.setRenderTarget(this.target);
      }
      this.place(content, within, worldFromScene);
      this.contents.children = [content.mesh];
      renderer.render(this.contents, camera);
    });
    this.contents.children = [];
    end?.(renderer, picture);
  }
}
