// The last pass of a `hash` scene's picture: in each pixel, the network that has the largest weight there converts the
// sums of all contents to a colour (docs/tile-format.md, section 7; NGP-RT, eq. 5). Each network has its own program,
// which covers the picture and discards the pixels of other networks.
import * as THREE from 'three';
import { displayConstants } from '../../draw/display-modes';
import { kHarmonics, layersShader, writtenVector } from '../../draw/network-shader';
import type { Picture } from '../../draw/picture';
import { kScreenVertexShader } from '../../draw/screen-triangle';
import type { ViewUniforms } from '../../raymarch/content-program';
import { packNetwork, type DenseLayer } from '../../tiles/network';
import { kHashModes } from './hash-modes';
import { kWeightsOfTarget, countNetworks } from './hash-program';

const kHead = `
precision highp float;
precision highp int;
precision highp sampler2D;
out vec4 colourAndOpacity;
uniform sampler2D opaqueDepth;
uniform vec2 resolution;
uniform vec4 part;
uniform mat3 ray;
uniform int display, network, behind;  // behind: the network of rays that hit nothing
uniform bool hasLearnedBackground;
`;

const kMain = `
vec3 sigmoid(vec3 x) {
  return 1.0 / (1.0 + exp(-x));
}
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 diffuse = texelFetch(diffuseAndOpacity, at, 0);
  float opacity = diffuse.a;
  bool open = hasLearnedBackground && texture(opaqueDepth, gl_FragCoord.xy / resolution).r >= 1.0;
  if (opacity <= 0.0 && !open) discard;
  if ((opacity > 0.0 ? heaviest(at, opacity) : behind) != network) discard;
  vec4 threeFeatures = texelFetch(featuresAndOpacity, at, 0);
  vec4 features = vec4(threeFeatures.xyz, texelFetch(weightsAndOpacity, at, 0).x);
  vec3 shown = features.rgb / max(opacity, 1e-6);  // of modes that show something other than the colour
  opacity = open ? 1.0 : threeFeatures.a;
  vec2 ndc = 2.0 * (gl_FragCoord.xy - part.xy) / part.zw - 1.0;
  vec3 seen = sigmoid(diffuse.rgb + viewDependent(diffuse.rgb, features, normalize(ray * vec3(ndc, 1.0))));
  vec3 colour = opacity * seen;
  if (display == kShowDiffuse) colour = opacity * sigmoid(diffuse.rgb);
  if (display == kShowSpecular) colour = opacity * clamp(0.5 + seen - sigmoid(diffuse.rgb), 0.0, 1.0);  // grey: no specular part
  if (display == kShowFeatures) colour = opacity * sigmoid(features.rgb);
  if (display == kShowAttention || display == kShowDensityAttention) {
    colour = opacity * pow(max(shown, 0.0), vec3(1.0 / 2.2));  // most values are small
  }
  if (display == kShowBlocks || display == kShowLevels) {
    colour = opacity * shown * (0.35 + 0.65 * dot(sigmoid(diffuse.rgb), vec3(0.3, 0.6, 0.1)));
  }
  colourAndOpacity = vec4(colour, opacity);
}`;

// Defines `int heaviest(ivec2 at, float opacity)`, the network with the largest weight, the first of equal ones.
function heaviestShader(weightTargets: number): string {
  const targets = ['weightsAndOpacity', ...[...Array(weightTargets).keys()].map((n) => `weights${n}AndOpacity`)];
  // Of the first target, x is a feature.
  const weightExpression = (n: number) => `t${Math.floor(n / kWeightsOfTarget)}.${'xyz'[n % kWeightsOfTarget]}`;
  const others = [...Array(countNetworks(weightTargets)).keys()].slice(1);
  return [
    `uniform sampler2D diffuseAndOpacity, featuresAndOpacity, ${targets.join(', ')};`,
    'int heaviest(ivec2 at, float opacity) {',
    ...targets.map((target, t) => `  vec4 t${t} = texelFetch(${target}, at, 0);`),
    `  float maximum = opacity - (${others.map(weightExpression).join(' + ')});`,
    '  int found = 0;',
    ...others.map((n) => `  if (${weightExpression(n)} > maximum) { maximum = ${weightExpression(n)}; found = ${n}; }`),
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

// A network of one or several contents: contents whose numbers are equal share one.
export interface DrawnNetwork {
  mesh: THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>;
  contents: number; // contents on the GPU that use it
}

// The number of networks that are kept while no content on the GPU uses them, so that a level that is loaded again
// finds its network.
const kMaxUnused = 16;

// The networks of the contents in a picture.
export interface NetworkOrder {
  networks: readonly DrawnNetwork[]; // each once, by index
  behind: number; // index of the network of rays that hit nothing
  hasLearnedBackground: boolean; // rays that hit nothing are opaque
}

export class NetworkPass {
  readonly target = new THREE.WebGLRenderTarget(1, 1, {
    generateMipmaps: false, depthBuffer: false, type: THREE.HalfFloatType, minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter,
  });
  private readonly networks = new Map<string, DrawnNetwork>();
  private readonly pass = new THREE.Scene();

  // `sums` is the target that hashPieces writes, with `weightTargets` weight attachments besides the first.
  constructor(
    private readonly sums: THREE.WebGLRenderTarget,
    private readonly screen: THREE.BufferGeometry,
    private readonly view: ViewUniforms,
    private readonly weightTargets: number,
  ) {}

  readonly bytesPerPixel = 8;

  // Returns the network with these numbers, creating it if necessary. A scene has one network per level of detail.
  getDrawnNetwork(network: DenseLayer[]): DrawnNetwork {
    const key = viewDependentShader(network);
    const known = this.networks.get(key);
    if (known) return known;
    const [diffuse, , features, ...weights] = this.sums.textures;
    const { opaqueDepth, resolution, part, ray, display } = this.view;
    const material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: kScreenVertexShader,
      fragmentShader: [kHead, displayConstants(kHashModes), heaviestShader(this.weightTargets), key, kMain].join('\n'),
      uniforms: {
        opaqueDepth, resolution, part, ray, display, network: { value: 0 }, behind: { value: 0 }, hasLearnedBackground: { value: false },
        diffuseAndOpacity: { value: diffuse }, featuresAndOpacity: { value: features }, weightsAndOpacity: { value: weights[0] },
        ...Object.fromEntries(weights.slice(1).map((value, n) => [`weights${n}AndOpacity`, { value }])),
      },
      depthTest: false, depthWrite: false, blending: THREE.NoBlending, toneMapped: false,
    });
    const mesh = new THREE.Mesh<THREE.BufferGeometry, THREE.RawShaderMaterial>(this.screen, material);
    mesh.frustumCulled = false;
    const drawnNetwork = { mesh, contents: 0 };
    this.networks.set(key, drawnNetwork);
    return drawnNetwork;
  }

  // Removes a content's reference to a network. At most kMaxUnused unused networks are kept.
  release(network: DrawnNetwork): void {
    --network.contents;
    const unused = [...this.networks].filter(([, { contents }]) => contents === 0);
    for (const [key, { mesh }] of unused.slice(0, Math.max(0, unused.length - kMaxUnused))) {
      mesh.material.dispose();
      this.networks.delete(key);
    }
  }

  resize(width: number, height: number): void {
    this.target.setSize(width, height);
  }

  // Draws into a cleared target; the view's uniforms must be those of the picture.
  draw(renderer: THREE.WebGLRenderer, { camera, part }: Picture, { networks, behind, hasLearnedBackground }: NetworkOrder): void {
    this.target.viewport.copy(part);
    renderer.setRenderTarget(this.target);
    networks.forEach(({ mesh }, number) => {
      const { uniforms } = mesh.material;
      uniforms.network.value = number;
      uniforms.behind.value = behind;
      uniforms.hasLearnedBackground.value = hasLearnedBackground;
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
