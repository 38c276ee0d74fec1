// The last step of a `hash` scene's picture: of what all contents together add up to in a pixel, the network that has the
// largest share in it makes a colour (docs/tile-format.md, section 7; NGP-RT, eq. 5). Each network has a program of its own,
// which fills the picture and leaves the other networks' pixels alone.
import * as THREE from 'three';
import { displayConstants } from '../../draw/display-modes';
import { layersShader, writtenVector } from '../../draw/network-shader';
import type { Picture } from '../../draw/picture';
import type { ViewUniforms } from '../../raymarch/content-program';
import { packNetwork, type DenseLayer } from '../../tiles/network';
import { kHashModes } from './hash-modes';
import { kWeightsOfTarget, networksOf } from './hash-program';

// The first 16 real spherical harmonics of d, in tiny-cuda-nn's order.
const kHarmonics = [
  '0.28209479', '-0.48860251 * d.y', '0.48860251 * d.z', '-0.48860251 * d.x', '1.09254843 * d.x * d.y', '-1.09254843 * d.y * d.z',
  '0.94617470 * d.z * d.z - 0.31539157', '-1.09254843 * d.x * d.z', '0.54627422 * (d.x * d.x - d.y * d.y)',
  '0.59004359 * d.y * (d.y * d.y - 3.0 * d.x * d.x)', '2.89061144 * d.x * d.y * d.z', '0.45704580 * d.y * (1.0 - 5.0 * d.z * d.z)',
  '0.37317633 * d.z * (5.0 * d.z * d.z - 3.0)', '0.45704580 * d.x * (1.0 - 5.0 * d.z * d.z)',
  '1.44530572 * d.z * (d.x * d.x - d.y * d.y)', '0.59004359 * d.x * (3.0 * d.y * d.y - d.x * d.x)',
];

const kVertexShader = `
in vec3 position;
void main() {
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const kHead = `
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 colourAndOpacity;
uniform sampler2D opaqueDepth;
uniform vec2 resolution;
uniform vec4 part;
uniform mat3 ray;
uniform int display, network, behind;  // behind: the network of rays that nothing meets
uniform bool whole;
`;

const kMain = `
vec3 sigmoid(vec3 x) {
  return 1.0 / (1.0 + exp(-x));
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 diffuse = texelFetch(diffuseAndOpacity, at, 0);
  float opacity = diffuse.a;
  bool open = whole && texture(opaqueDepth, gl_FragCoord.xy / resolution).r >= 1.0;
  if (opacity <= 0.0 && !open) discard;
  if ((opacity > 0.0 ? heaviest(at, opacity) : behind) != network) discard;
  vec4 threeFeatures = texelFetch(featuresAndOpacity, at, 0);
  vec4 features = vec4(threeFeatures.xyz, texelFetch(weightsAndOpacity, at, 0).x);
  vec3 shown = features.rgb / max(opacity, 1e-6);  // of modes that show something else instead
  opacity = open ? 1.0 : threeFeatures.a;
  vec2 ndc = 2.0 * (gl_FragCoord.xy - part.xy) / part.zw - 1.0;
  vec3 seen = sigmoid(diffuse.rgb + viewDependent(diffuse.rgb, features, normalize(ray * vec3(ndc, 1.0))));
  vec3 colour = opacity * seen;
  if (display == kShowDiffuse) colour = opacity * sigmoid(diffuse.rgb);
  if (display == kShowSpecular) colour = opacity * clamp(0.5 + seen - sigmoid(diffuse.rgb), 0.0, 1.0);  // grey: nothing
  if (display == kShowFeatures) colour = opacity * sigmoid(features.rgb);
  if (display == kShowAttention || display == kShowDensityAttention) {
    colour = opacity * pow(max(shown, 0.0), vec3(1.0 / 2.2));  // most are small
  }
  if (display == kShowBlocks || display == kShowLevels) {
    colour = opacity * shown * (0.35 + 0.65 * dot(sigmoid(diffuse.rgb), vec3(0.3, 0.6, 0.1)));
  }
  colourAndOpacity = vec4(colour, opacity);
}`;

// `int heaviest(ivec2 at, float opacity)`: of equals the first.
function heaviestShader(weightTargets: number): string {
  const targets = ['weightsAndOpacity', ...[...Array(weightTargets).keys()].map((n) => `weights${n}AndOpacity`)];
  const weightOf = (n: number) => `t${Math.floor(n / kWeightsOfTarget)}.${'xyz'[n % kWeightsOfTarget]}`; // of the first x is a feature
  const others = [...Array(networksOf(weightTargets)).keys()].slice(1);
  return [
    `uniform sampler2D diffuseAndOpacity, featuresAndOpacity, ${targets.join(', ')};`,
    'int heaviest(ivec2 at, float opacity) {',
    ...targets.map((target, t) => `  vec4 t${t} = texelFetch(${target}, at, 0);`),
    `  float most = opacity - (${others.map(weightOf).join(' + ')});`,
    '  int found = 0;',
    ...others.map((n) => `  if (${weightOf(n)} > most) { most = ${weightOf(n)}; found = ${n}; }`),
    '  return found;', '}',
  ].join('\n');
}

function viewDependentShader(network: DenseLayer[]): string {
  const packed = packNetwork(network);
  const xyz = (name: string) => ['x', 'y', 'z'].map((axis) => `${name}.${axis}`);
  const inputs = [...xyz('diffuse'), ...xyz('features'), 'features.w', ...kHarmonics.map((_, k) => `y${k}`)];
  const { lines, outputs } = layersShader(inputs, network, (n) => writtenVector(packed, n));
  return [
    'vec3 viewDependent(vec3 diffuse, vec4 features, vec3 d) {', ...kHarmonics.map((harmonic, k) => `  float y${k} = ${harmonic};`),
    ...lines, `  return vec3(${outputs.join(', ')});`, '}',
  ].join('\n');
}

// Of one or several contents: those that have the same numbers have the same.
export interface DrawnNetwork {
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  contents: number; // that are on the card
}

// As many as are kept with no content on the card that has them: so that a level that comes back finds its own.
const kMostUnused = 16;

// What of a picture's contents there is to know.
export interface NetworkOrder {
  networks: readonly DrawnNetwork[]; // each once, by their numbers
  behind: number; // which of them rays have that nothing meets
  whole: boolean; // rays that end nowhere are opaque
}

export class NetworkPass {
  readonly target = new THREE.WebGLRenderTarget(1, 1, {
    generateMipmaps: false, depthBuffer: false, type: THREE.HalfFloatType, minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter,
  });
  private readonly networks = new Map<string, DrawnNetwork>();
  private readonly pass = new THREE.Scene();

  // `sums` are those that hashPieces writes, with so many targets of weights beyond the first.
  constructor(
    private readonly sums: THREE.WebGLRenderTarget,
    private readonly screen: THREE.BufferGeometry,
    private readonly view: ViewUniforms,
    private readonly weightTargets: number,
  ) {}

  get bytes(): number {
    return 8 * this.target.width * this.target.height;
  }

  // A scene has one for each level of detail.
  networkOf(network: DenseLayer[]): DrawnNetwork {
    const key = viewDependentShader(network);
    const known = this.networks.get(key);
    if (known) return known;
    const [diffuse, , features, ...weights] = this.sums.textures;
    const { opaqueDepth, resolution, part, ray, display } = this.view;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: kVertexShader,
      fragmentShader: [kHead, displayConstants(kHashModes), heaviestShader(this.weightTargets), key, kMain].join('\n'),
      uniforms: {
        opaqueDepth, resolution, part, ray, display, network: { value: 0 }, behind: { value: 0 }, whole: { value: false },
        diffuseAndOpacity: { value: diffuse }, featuresAndOpacity: { value: features }, weightsAndOpacity: { value: weights[0] },
        ...Object.fromEntries(weights.slice(1).map((value, n) => [`weights${n}AndOpacity`, { value }])),
      },
      depthTest: false, depthWrite: false, blending: THREE.NoBlending, toneMapped: false,
    });
    const mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>(this.screen, material);
    mesh.frustumCulled = false;
    const made = { mesh, contents: 0 };
    this.networks.set(key, made);
    return made;
  }

  // Of which as many are kept as scenes have levels; others go when no content has them.
  release(network: DrawnNetwork): void {
    --network.contents;
    const unused = [...this.networks].filter(([, { contents }]) => contents === 0);
    for (const [key, { mesh }] of unused.slice(0, Math.max(0, unused.length - kMostUnused))) {
      mesh.material.dispose();
      this.networks.delete(key);
    }
  }

  resize(width: number, height: number): void {
    this.target.setSize(width, height);
  }

  // Into a target that has been cleared; the view's uniforms are the picture's.
  draw(renderer: THREE.WebGLRenderer, { camera, part }: Picture, { networks, behind, whole }: NetworkOrder): void {
    this.target.viewport.copy(part);
    renderer.setRenderTarget(this.target);
    networks.forEach(({ mesh }, number) => {
      const { uniforms } = mesh.material;
      uniforms.network.value = number;
      uniforms.behind.value = behind;
      uniforms.whole.value = whole;
      this.pass.children = [mesh];
      renderer.render(this.pass, camera);
    });
    this.pass.children = [];
  }

  dispose(): void {
    this.target.dispose();
    for (const { mesh } of this.networks.values()) mesh.material.dispose();
    this.networks.clear();
  }
}
