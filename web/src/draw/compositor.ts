// Draws contents, front to back, into targets of their own: what the scene adds to each pixel, and how far away it is
// (docs/tile-format.md, section 4).
import * as THREE from 'three';
import type { Box, TileContent, Vec3 } from '../tiles/tileset';
import type { DenseLayer, VolumePart } from '../tiles/volume-content';
import { frontToBack as orderOf } from './box-order';
import { colourOfBlock, colourOfLevel } from './display-modes';
import { packNetwork } from './network-shader';
import { kMostHiddenBoxes, programMaterial, volumeMaterial, viewUniforms, type ProgramShape, type ViewUniforms } from './volume-material';
import { SceneError } from '../scene-error';
import type { ContentTextures } from './content-textures';

// A content that may be drawn.
export interface DrawnContent {
  textures: ContentTextures;
  box: Box; // scene units
  surround: boolean;
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
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

// Puts the nearest depth where nothing of what comes next would be seen: it is not even begun there.
const kHideShader = `
uniform sampler2D colourAndOpacity;
uniform float minTransmittance;
void main() {
  if (1.0 - texelFetch(colourAndOpacity, ivec2(gl_FragCoord.xy), 0).a >= minTransmittance) discard;
  gl_FragColor = vec4(0.0);
}`;

const kContentsBetweenHiding = 4;

export class Compositor {
  readonly view: ViewUniforms = viewUniforms();
  readonly target: THREE.WebGLRenderTarget; // what the scene adds, with its opacity; how far its surface is
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
  prepare(renderer: THREE.WebGLRenderer, parts: VolumePart[], network: DenseLayer[], surround: boolean, ownProgram: boolean): void {
    const shape = this.shapeOf(parts, network.map((layer) => layer.outputs), surround, ownProgram ? packNetwork(network) : undefined);
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
    const shape = this.shapeOf(textures.parts, textures.widths, surround, ownProgram ? textures.network : undefined);
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

  get bytes(): number {
    return (this.bytesPerPixel + 4 + 1) * this.target.width * this.target.height;
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

  // `worldFromScene`: of three's world. Draws into `target`; rays end at the depth of what is opaque, if that is given.
  draw(
    renderer: THREE.WebGLRenderer, camera: THREE.Camera, worldFromScene: THREE.Matrix4, frontToBack: DrawnContent[],
    opaqueDepth: THREE.Texture | null,
  ): void {
    this.setView(camera, worldFromScene);
    this.view.opaqueDepth.value = opaqueDepth ?? this.nothingOpaque;
    const box = new THREE.Matrix4();
    const eye = this.eye(camera, worldFromScene);
    for (const { textures, mesh, box: { low, high } } of frontToBack) {
      if (this.cuts && !('CUTS' in mesh.material.defines)) {
        mesh.material.defines.CUTS = '';
        mesh.material.needsUpdate = true;
      }
      if (textures.parts.length > 1) textures.orderParts(orderOf(textures.parts, eye));
      const middle = (a: number) => (low[a] + high[a]) / 2;
      box.makeScale(high[0] - low[0], high[1] - low[1], high[2] - low[2]).setPosition(middle(0), middle(1), middle(2));
      mesh.matrixWorld.multiplyMatrices(worldFromScene, box);
    }
    const before = renderer.getRenderTarget();
    const autoClear = renderer.autoClear;
    const clearColour = renderer.getClearColor(new THREE.Color());
    const clearAlpha = renderer.getClearAlpha();
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0, 0);
    renderer.autoClear = false;
    renderer.clear();
    const hides = this.view.minTransmittance.value > 0;
    frontToBack.forEach((content, i) => {
      if (hides && i > 0 && (content.surround || i % kContentsBetweenHiding === 0)) {
        renderer.setRenderTarget(this.depthAlone);
        renderer.render(this.hiding, camera);
        renderer.setRenderTarget(this.target);
      }
      this.contents.children = [content.mesh];
      renderer.render(this.contents, camera);
    });
    this.contents.children = [];
    renderer.autoClear = autoClear;
    renderer.setClearColor(clearColour, clearAlpha);
    renderer.setRenderTarget(before);
  }

  // Where the surface is in the last picture, scene units; `at` runs from -1 to 1 across it, upwards.
  surfaceAt(renderer: THREE.WebGLRenderer, at: THREE.Vector2): THREE.Vector3 | undefined {
    const { width, height } = this.target;
    const pixel = (x: number, size: number) => Math.min(Math.max(Math.floor((0.5 + 0.5 * x) * size), 0), size - 1);
    const { type } = this.target.textures[1];
    const read = type === THREE.FloatType ? new Float32Array(4) : type === THREE.HalfFloatType ? new Uint16Array(4) : new Uint8Array(4);
    renderer.readRenderTargetPixels(this.target, pixel(at.x, width), pixel(at.y, height), 1, 1, read, undefined, 1);
    const [value, , , hides] = [...read].map(
      (x) => (type === THREE.FloatType ? x : type === THREE.HalfFloatType ? THREE.DataUtils.fromHalfFloat(x) : x / 255));
    if (hides <= 0.99) return undefined;
    const distance = this.distancesOfBytes ? value / hides / Math.max(1 - value / hides, 1e-3) : value / hides;
    const inPicture = new THREE.Vector3(at.x, at.y, 1);
    const direction = inPicture.clone().applyMatrix3(this.view.ray.value).normalize();
    return inPicture.applyMatrix3(this.view.origin.value).addScaledVector(direction, distance);
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

  private shapeOf(parts: VolumePart[], widths: number[], surround: boolean, packed: Float32Array | undefined): ProgramShape {
    // What is contracted may own what lies beyond any box.
    const everywhere = surround || parts.some((part) => part.contracted);
    const network = packed?.every(Number.isFinite) ? packed : undefined;
    return { parts: parts.length, widths, surround, everywhere, distancesOfBytes: this.distancesOfBytes, cuts: this.cuts, network };
  }

  // Of a parallel projection, so far behind the picture that its rays come from there.
  private eye(camera: THREE.Camera, worldFromScene: THREE.Matrix4): Vec3 {
    const isPerspective = camera.projectionMatrix.elements[15] === 0;
    const place = new THREE.Vector3().setFromMatrixPosition(camera.matrixWorld);
    if (!isPerspective) place.addScaledVector(new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 2), 1e7);
    return place.applyMatrix4(worldFromScene.clone().invert()).toArray() as unknown as Vec3;
  }

  private setView(camera: THREE.Camera, worldFromScene: THREE.Matrix4): void {
    const sceneFromCamera = worldFromScene.clone().invert().multiply(camera.matrixWorld);
    const sceneFromClip = sceneFromCamera.clone().multiply(camera.projectionMatrixInverse);
    this.view.sceneFromDepth.value.copy(sceneFromClip);
    // Where the near plane is, which is linear in ndc for every pinhole and every parallel projection.
    const at = (x: number, y: number) => new THREE.Vector3(x, y, -1).applyMatrix4(sceneFromClip);
    const [middle, right, up] = [at(0, 0), at(1, 0), at(0, 1)];
    const across = right.sub(middle);
    const along = up.sub(middle);
    const isPerspective = camera.projectionMatrix.elements[15] === 0;
    const eye = new THREE.Vector3().setFromMatrixPosition(sceneFromCamera);
    const zero = new THREE.Vector3();
    const columns = (a: THREE.Vector3, b: THREE.Vector3, c: THREE.Vector3) =>
      [a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z];
    if (isPerspective) {
      this.view.origin.value.fromArray(columns(zero, zero, eye));
      this.view.ray.value.fromArray(columns(across, along, middle.sub(eye)));
    } else {
      const forward = new THREE.Vector3().setFromMatrixColumn(sceneFromCamera, 2).negate();
      this.view.origin.value.fromArray(columns(across, along, middle));
      this.view.ray.value.fromArray(columns(zero, zero, forward));
    }
  }
}
