// Colours the pixels of each part: samples its features, and evaluates its network, once per pixel. Each part is drawn as
// a rectangle of the screen around its triangles, with a program to which its network is uniform. The depth buffer sorts
// the pixels by part: the depth of a pixel stands for the part that is visible there, that of a rectangle for its part,
// and only equal depths pass.
import * as THREE from 'three';
import { kHarmonics, layersShader, writtenVector } from '../../draw/network-shader';
import { drawsOnCpu } from '../../draw/software-renderer';
import { networkVectors, packNetwork, type DenseLayer } from '../../tiles/network';
import { kFeatures, type MeshPart } from './mesh-content';
import type { PartTextures } from './mesh-textures';
import { kNoisyOpacity, kPassHead, kRayOfVertexSource } from './passes';
import { kHalfTransparent, kModeConstants } from './raster-program';
import type { ScreenRectangle } from './patch-chunks';

const kWidth = 2048; // texels, which all GPUs support
const kOtherUniforms = 32; // vectors, at most
const kVectorsBeforeNetwork = kFeatures / 2 + 2; // ranges, colour of the block, colour of the level

// Depths, as fixed-point numbers of 24 bits or floating-point numbers, distinguish these numbers exactly.
const kMaxParts = 2 ** 18;
const kPartsOfDepth = 2 ** 20;

const kPartDepthSource = `
// Returns the depth that stands for a part; 0: what shows none.
float partDepth(uint number) {
  return float(number + 1u) / ${kPartsOfDepth}.0;
}`;

// The vertex shader of passes that colour a rectangle of the pixels of a part.
const kRectangleVertexShader = `
${kRayOfVertexSource}
in vec3 position;
uniform vec4 rectangle;  // two opposite corners, from -1 to 1
uniform uint partNumber;
out vec3 rayDirection;  // not normalised
${kPartDepthSource}
void main() {
  gl_Position = vec4(mix(rectangle.xy, rectangle.zw, position.xy), 2.0 * partDepth(partNumber) - 1.0, 1.0);
  rayDirection = ray * ndcOfVertex(gl_Position.xy);
}`;

// Sorts the pixels: writes the depths that stand for their parts.
export const kSortShader = `${kPassHead}
out vec4 colour;
uniform usampler2D visible;
${kPartDepthSource}
void main() {
  colour = vec4(0.0);
  gl_FragDepth = partDepth(texelFetch(visible, ivec2(gl_FragCoord.xy), 0).x & ${kHalfTransparent - 1}u);
}`;

// Where the vectors of a part are. `written`: in its program, apart from those before the network. Mesa's driver for the CPU
// reads uniforms many times more slowly than numbers in the program. Parts with the same network share a program.
type VectorPlace = 'uniforms' | 'texture' | 'written';

// `isInspected`: as a display mode shows them. That is a program of its own, because drivers for the CPU evaluate all
// branches.
function colourShader(network: DenseLayer[], isCompressed: boolean, isInspected: boolean, vectorPlace: VectorPlace): string {
  const packed = packNetwork(network);
  const vectors = kVectorsBeforeNetwork + (vectorPlace === 'written' ? 0 : packed.length / 4);
  const features = [...Array(kFeatures).keys()].map((f) => `f${f >> 2}.${'xyzw'[f & 3]}`);
  const harmonics = kHarmonics.slice(0, network[0].inputs - kFeatures);
  const vector = (n: number) => {
    if (vectorPlace === 'texture') return `texelFetch(vectors, ivec2(${n % kWidth}, ${Math.floor(n / kWidth)}), 0)`;
    return n < vectors ? `vectors[${n}]` : writtenVector(packed, n - vectors);
  };
  const evaluate = (name: string, ofDirection: string[]) => {
    const { lines, outputs } = layersShader([...features, ...ofDirection], network, (n) => vector(kVectorsBeforeNetwork + n));
    return [`vec3 ${name}(vec4 f0, vec4 f1, vec3 d) {`, ...lines, `  return 1.0 / (1.0 + exp(-vec3(${outputs.join(', ')})));`, '}'].join('\n');
  };
  const sample = (layer: number) => `textureLod(featureTexels, vec3(place, ${layer}.0), 0.0)`;
  const [first, second] = isCompressed
    ? [0, 2].map((layer) => `vec4(${sample(layer)}.rg, ${sample(layer + 1)}.rg)`)
    : [sample(0), sample(1)];
  return `${kPassHead}
precision highp sampler2DArray;
${isInspected ? '#define INSPECTED' : ''}
${kModeConstants}
in vec3 rayDirection;
out vec4 colour;
uniform usampler2D visible;
uniform sampler2DArray featureTexels;
uniform int display;
uniform ${vectorPlace === 'texture' ? 'sampler2D vectors' : `vec4 vectors[${vectors}]`};
${evaluate('decode', harmonics.map((one) => `(${one})`))}
#ifdef INSPECTED
${evaluate('withoutDirection', harmonics.map((_, i) => (i === 0 ? kHarmonics[0] : '0.0')))}
#endif
void main() {
  uvec4 seen = texelFetch(visible, ivec2(gl_FragCoord.xy), 0);
  vec2 place = uintBitsToFloat(seen.zw);
  vec4 first = ${first}, second = ${second};
  vec4 f0 = ${vector(0)} + ${vector(2)} * first, f1 = ${vector(1)} + ${vector(3)} * second;
  vec3 d = normalize(rayDirection);
#ifdef INSPECTED
  vec3 shown;
  if (display == kShowTriangles || display == kShowAlpha) {
    shown = vec3(seen.w & 255u, seen.w >> 8 & 255u, seen.w >> 16 & 255u) / 255.0;
  } else if (display == kShowFeatures) {
    shown = first.rgb;
  } else if (display == kShowDiffuse) {
    shown = withoutDirection(f0, f1, d);
  } else {
    shown = decode(f0, f1, d);
    if (display == kShowSpecular) shown = clamp(0.5 + shown - withoutDirection(f0, f1, d), 0.0, 1.0);
    vec3 tint = display == kShowBlocks ? ${vector(4)}.rgb : ${vector(5)}.rgb;
    if (display == kShowBlocks || display == kShowLevels) shown = tint * (0.35 + 0.65 * dot(shown, vec3(0.3, 0.6, 0.1)));
  }
#else
  vec3 shown = decode(f0, f1, d);
#endif
  colour = vec4(shown, (seen.x & ${kHalfTransparent}u) != 0u ? ${kNoisyOpacity} : 1.0);
}`;
}

// Passes that draw where the depth of a pixel equals theirs.
export function rectangleMaterial(fragmentShader: string, uniforms: Record<string, THREE.IUniform>): THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader: kRectangleVertexShader, fragmentShader, uniforms,
    depthTest: true, depthWrite: false, depthFunc: THREE.EqualDepth, blending: THREE.NoBlending, toneMapped: false,
  });
}

// A part as it is coloured.
export interface ColouredPart {
  number: number; // counted from 1
  colours: RectangleMesh;
  inspector: RectangleMesh; // for display modes; compiled when they are shown
}

type Uniforms = Record<string, THREE.IUniform>;
type RectangleMesh = THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;

export const kWholeScreen: ScreenRectangle = [-1, -1, 1, 1];

export class PartColours {
  private readonly corners = rectangleCorners();
  private readonly prepared = new Map<string, RectangleMesh>(); // one for each program, which it keeps alive
  private readonly users = new Map<string, number>(); // of a program: the parts that have it
  private readonly numbers: boolean[] = [true]; // whether each is taken; 0 stands for no part
  private readonly uniformVectors: number; // of a program, at most
  private readonly drawsOnCpu: boolean;

  constructor(private readonly renderer: THREE.WebGLRenderer, private readonly uniforms: Uniforms) {
    const gl = renderer.getContext() as WebGL2RenderingContext;
    this.uniformVectors = (gl.getParameter(gl.MAX_FRAGMENT_UNIFORM_VECTORS) as number) - kOtherUniforms;
    this.drawsOnCpu = drawsOnCpu(gl);
  }

  get bytes(): number {
    return 4 * 3 * 4 + 2 * 6;
  }

  get areReady(): boolean {
    return [...this.prepared.values()].every(({ material }) => {
      const { currentProgram } = this.renderer.properties.get(material) as { currentProgram?: { isReady(): boolean } };
      return currentProgram?.isReady() ?? true;
    });
  }

  // Returns the bytes of the numbers of a part on the GPU.
  bytesOfPart({ network }: Pick<MeshPart, 'network'>): number {
    return this.place(network) === 'texture' ? 16 * kWidth * Math.ceil((kVectorsBeforeNetwork + networkVectors(network)) / kWidth) : 0;
  }

  // Lets the driver start to compile what such a part needs, in the background.
  prepare({ network }: MeshPart, isCompressed: boolean, camera: THREE.Camera): void {
    const shader = colourShader(network, isCompressed, false, this.place(network));
    if (this.prepared.has(shader)) return;
    const mesh = this.makeMesh(rectangleMaterial(shader, this.uniforms));
    this.prepared.set(shader, mesh);
    this.renderer.compile(mesh, camera);
  }

  makeMesh(material: THREE.RawShaderMaterial): RectangleMesh {
    const mesh = new THREE.Mesh(this.corners, material);
    mesh.frustumCulled = false;
    return mesh;
  }

  add(
    part: MeshPart, isCompressed: boolean, { features }: PartTextures, ofBlock: THREE.Color, ofLevel: THREE.Color, camera: THREE.Camera,
  ): ColouredPart {
    this.prepare(part, isCompressed, camera); // again, if the last part that used it has been removed since
    const { ranges, network } = part;
    const place = this.place(network);
    const vectors = new Float32Array(4 * (kVectorsBeforeNetwork + (place === 'written' ? 0 : networkVectors(network))));
    ranges.forEach(([low, high], f) => {
      vectors[f] = low;
      vectors[kFeatures + f] = high - low;
    });
    vectors.set([...ofBlock.toArray(), 0, ...ofLevel.toArray(), 0], 2 * kFeatures);
    if (place !== 'written') vectors.set(packNetwork(network), 4 * kVectorsBeforeNetwork);
    const free = this.numbers.indexOf(false);
    const number = free < 0 ? this.numbers.length : free;
    if (number >= kMaxParts) throw new Error('more parts than depths can distinguish');
    this.numbers[number] = true;
    const uniforms = {
      ...this.uniforms, featureTexels: { value: features }, partNumber: { value: number }, rectangle: { value: new THREE.Vector4() },
      vectors: { value: place === 'texture' ? vectorTexture(vectors) : vectors },
    };
    const [colours, inspector] = [false, true].map((isInspected) =>
      this.makeMesh(rectangleMaterial(colourShader(network, isCompressed, isInspected, place), uniforms)));
    const { fragmentShader } = colours.material;
    this.users.set(fragmentShader, (this.users.get(fragmentShader) ?? 0) + 1);
    return { number, colours, inspector };
  }

  remove({ number, colours, inspector }: ColouredPart): void {
    this.numbers[number] = false;
    const { vectors } = colours.material.uniforms;
    if (vectors.value instanceof THREE.Texture) vectors.value.dispose();
    colours.material.dispose();
    inspector.material.dispose();
    const { fragmentShader } = colours.material;
    const users = this.users.get(fragmentShader)! - 1;
    if (users > 0 || !this.drawsOnCpu) { // programs for all networks of a shape are few
      this.users.set(fragmentShader, users);
      return;
    }
    this.prepared.get(fragmentShader)?.material.dispose();
    this.prepared.delete(fragmentShader);
    this.users.delete(fragmentShader);
  }

  dispose(): void {
    this.corners.dispose();
    for (const { material } of this.prepared.values()) material.dispose();
  }

  private place(network: DenseLayer[]): VectorPlace {
    if (this.drawsOnCpu) return 'written';
    return kVectorsBeforeNetwork + networkVectors(network) <= this.uniformVectors ? 'uniforms' : 'texture';
  }
}

function vectorTexture(vectors: Float32Array): THREE.DataTexture {
  const height = Math.ceil(vectors.length / 4 / kWidth);
  const texels = new Float32Array(4 * kWidth * height);
  texels.set(vectors);
  const texture = new THREE.DataTexture(texels, kWidth, height, THREE.RGBAFormat, THREE.FloatType);
  texture.minFilter = texture.magFilter = THREE.NearestFilter;
  texture.needsUpdate = true;
  return texture;
}

// Returns a rectangle from 0 to 1.
function rectangleCorners(): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0]), 3));
  geometry.setIndex(new THREE.BufferAttribute(new Uint16Array([0, 1, 2, 2, 1, 3]), 1));
  geometry.boundingSphere = new THREE.Sphere();
  return geometry;
}
