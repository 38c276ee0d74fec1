// The shader that draws one content: what it adds to each pixel, as colour, opacity and distance (docs/tile-format.md,
// sections 4 and 6).
import * as THREE from 'three';
import marchSource from '../../../shaders/lib/volume_march.glsl?raw';
import pathSource from '../../../shaders/lib/volume_path.glsl?raw';
import { kVectorsOfPart } from '../tiles/volume-content';
import type { ContentTextures } from './content-textures';
import { kDisplayConstants } from './display-modes';
import { kMostHiddenBoxes } from './hidden-boxes';
import { networkShader, vectorsOfNetwork, writtenVector } from './network-shader';

export const kFarAway = 1e30; // scene units

// The same for all contents of a picture. Scene units; `part`, `origin`, `ray` and `sceneFromClip` are those of Picture.
export interface ViewUniforms {
  resolution: { value: THREE.Vector2 }; // pixels of the target
  part: { value: THREE.Vector4 };
  origin: { value: THREE.Matrix3 };
  ray: { value: THREE.Matrix3 };
  sceneLow: { value: THREE.Vector3 };
  sceneHigh: { value: THREE.Vector3 };
  sceneNear: { value: number };
  visibility: { value: number }; // how far beyond the scene's box anything is seen, above 0
  withinLow: { value: THREE.Vector3 }; // of the content that comes next, where it is drawn; not of surrounds
  withinHigh: { value: THREE.Vector3 };
  minTransmittance: { value: number }; // rays end where less would be seen; 0: never
  opaqueDepth: { value: THREE.Texture | null }; // of the depth buffer of what stands in the scene; 1 everywhere where nothing does
  sceneFromClip: { value: THREE.Matrix4 };
  display: { value: number }; // of kDisplayModes
  boxFromScene: { value: THREE.Matrix4[] }; // of boxes in which nothing is drawn, |x| <= 1/2 in each
  hiddenBoxes: { value: number }; // so many of them for what is no surround
  hiddenBoxesOfSurround: { value: number }; // and for the surround
  withinBox: { value: boolean }; // nothing is drawn outside of the scene's box
}

export function viewUniforms(): ViewUniforms {
  return {
    resolution: { value: new THREE.Vector2(1, 1) },
    part: { value: new THREE.Vector4(0, 0, 1, 1) },
    origin: { value: new THREE.Matrix3() },
    ray: { value: new THREE.Matrix3() },
    sceneLow: { value: new THREE.Vector3() },
    sceneHigh: { value: new THREE.Vector3() },
    sceneNear: { value: 0 },
    visibility: { value: kFarAway },
    withinLow: { value: new THREE.Vector3() },
    withinHigh: { value: new THREE.Vector3() },
    minTransmittance: { value: 1 / 255 },
    opaqueDepth: { value: null },
    sceneFromClip: { value: new THREE.Matrix4() },
    display: { value: 0 },
    boxFromScene: { value: Array.from({ length: 2 * kMostHiddenBoxes }, () => new THREE.Matrix4()) },
    hiddenBoxes: { value: 0 },
    hiddenBoxesOfSurround: { value: 0 },
    withinBox: { value: false },
  };
}

const kVertexShader = `
in vec3 position;
uniform mat4 modelViewMatrix, projectionMatrix;
void main() {
#ifdef EVERYWHERE
  gl_Position = vec4(position.xy, 0.0, 1.0);
#else
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
  gl_Position.z = 0.0;  // no plane of the camera cuts it off
#endif
}`;

const kFragmentHead = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
precision highp sampler2DArray;
layout(location = 0) out vec4 colourAndOpacity;
layout(location = 1) out vec4 distanceAndOpacity;
layout(std140) uniform Content { vec4 content[VECTORS]; };
uniform sampler2DArray planesFirst, planesSecond;
uniform sampler3D macroblocks, distances;
uniform sampler2D opaqueDepth;
uniform float featureRange, densityRange, stepsPerTexel, minTransmittance, sceneNear, visibility;
uniform vec2 resolution;
uniform vec4 part;
uniform mat3 origin, ray;
uniform mat4 sceneFromClip;
uniform vec3 sceneLow, sceneHigh, withinLow, withinHigh, colourOfBlock, colourOfLevel;
uniform int display;
#ifdef CUTS
uniform int hiddenBoxes;
uniform mat4 boxFromScene[${2 * kMostHiddenBoxes}];
uniform bool withinBox;
#else
const bool withinBox = false;
#endif
`;

const kFragmentMain = `
const float kSceneEnd = 1e6;

// Where ordinary models end the ray.
float opaqueDistance(vec2 ndc, vec3 o, vec3 d) {
  float depth = texture(opaqueDepth, gl_FragCoord.xy / resolution).r;
  if (depth >= 1.0) return kSceneEnd;
  vec4 x = sceneFromClip * vec4(ndc, 2.0 * depth - 1.0, 1.0);
  return dot(x.xyz / x.w - o, d);
}

// What of range lies in no hidden box, piece by piece. Boxes are cut out of rays, where lengths are those of the scene
// whatever is contracted.
#ifdef CUTS
void marchShown(Part part, vec3 o, vec3 d, vec2 range, inout Composite sum) {
  float t = range.x;
  int guard = 0;
  do {
    float exit = t, next = range.y;  // of the boxes that t lies in; the first that comes
    for (int n = 0; n < hiddenBoxes; ++n) {
      vec2 hidden = clipToBox((boxFromScene[n] * vec4(o, 1.0)).xyz, mat3(boxFromScene[n]) * d, vec3(-0.5), vec3(0.5), range);
      if (hidden.x >= hidden.y || hidden.y <= t) continue;
      if (hidden.x <= t) exit = max(exit, hidden.y);
      else next = min(next, hidden.x);
    }
    if (exit == t) {
      marchPart(part, o, d, vec2(t, next), sum);
      exit = next;
    }
    t = exit;
  } while (t < range.y && sum.transmittance >= minTransmittance && ++guard < ${4 * kMostHiddenBoxes + 1});
}
#else
#define marchShown marchPart
#endif

void main() {
  vec2 ndc = 2.0 * (gl_FragCoord.xy - part.xy) / part.zw - 1.0;
  vec3 o = origin * vec3(ndc, 1.0), d = normalize(ray * vec3(ndc, 1.0));
  vec2 box = clipToBox(o, d, sceneLow, sceneHigh, vec2(sceneNear, 1e30));
  bool meetsBox = box.x < box.y;
  if (withinBox && !meetsBox) discard;
  float far = min(withinBox ? box.y : kSceneEnd, opaqueDistance(ndc, o, d));
  Composite sum = Composite(vec3(0.0), vec4(0.0), 1.0, 0.0, 0.0);
#ifdef SURROUND
  vec2 behind = vec2(meetsBox ? box.y : sceneNear, far);
  if (behind.x < behind.y) marchShown(partOf(0), o, d, behind, sum);
#else
  vec2 whole = clipToBox(o, d, withinLow, withinHigh, vec2(meetsBox ? box.x : sceneNear, far));
  for (int n = 0; n < PARTS; ++n) {
    Part part = partOf(n);
    vec2 owned = ownedRange(part, o, d, whole);
    if (owned.x < owned.y) marchShown(part, o, d, owned, sum);
    if (sum.transmittance < minTransmittance) break;
  }
#endif
  float opacity = 1.0 - sum.transmittance;
  if (opacity <= 0.0) discard;
  vec3 specular = deferred(sum.diffuse, sum.features, d);
  vec3 colour = sum.diffuse + opacity * specular;
  if (display == kShowDiffuse) colour = sum.diffuse;
  if (display == kShowSpecular) colour = opacity * specular;
  if (display == kShowFeatures) colour = sum.features.rgb;
  if (display == kShowBlocks || display == kShowLevels) {
    vec3 tint = display == kShowBlocks ? colourOfBlock : colourOfLevel;
    colour = tint * (0.35 * opacity + 0.65 * dot(colour, vec3(0.3, 0.6, 0.1)));
  }
  // What hides half is where the surface is, whatever shines through it from far behind, and whatever haze is before it.
  float surface = sum.median > 0.0 ? sum.median : sum.depth / opacity;
#ifdef EVERYWHERE
  vec3 x = o + surface * d;
  float seen = 1.0 - smoothstep(0.1 * visibility, visibility, length(max(max(sceneLow - x, x - sceneHigh), 0.0)));
  colour *= seen;
  opacity *= seen;
#endif
  colourAndOpacity = vec4(colour, opacity);
  float hides = clamp(4.0 * opacity - 1.0, 0.0, 1.0);
#ifdef DISTANCES_OF_BYTES
  surface /= surface + 1.0;
#else
  surface = min(surface, 60000.0);  // half floats end at 65504
#endif
  distanceAndOpacity = vec4(surface * hides, 0.0, 0.0, hides);
}`;

// Defines voxelFirst and voxelSecond: texels of an atlas that may be cut into several textures, one above the other. No
// sample lies between two of them, as macroblocks have their apron.
function atlasShader(atlases: number): string {
  const numbers = [...Array(atlases).keys()];
  const look = (which: string) => {
    const last = numbers.length - 1;
    const lines = numbers.map((n) => {
      const found = `return textureLod(voxels${which}${n}, x * inTexture[${n}], 0.0);`;
      return n === last ? found : `if (x.z < atlasDepth) ${found}\n  x.z -= atlasDepth;`;
    });
    return `vec4 voxel${which}(vec3 x) {\n  ${lines.join('\n  ')}\n}`;
  };
  return [
    `uniform vec3 inTexture[${atlases}];  // of a texel: 1 / size\nuniform float atlasDepth;`,
    ...numbers.map((n) => `uniform sampler3D voxelsFirst${n}, voxelsSecond${n};`), look('First'), look('Second'),
  ].join('\n');
}

// What a program depends on.
export interface ProgramShape {
  parts: number;
  atlases: number; // textures that the atlas of voxels is cut into
  widths: number[]; // outputs of the network's layers
  surround: boolean;
  everywhere: boolean; // fills the picture, as it owns what lies beyond any box
  distancesOfBytes: boolean; // the target's are, from 0 for no distance to 255 for the farthest
  cuts: boolean; // knows hidden boxes, which costs a hundredth even where there are none
  network?: Float32Array; // packed; written into the program, which then is of one content alone
}

// Without uniforms: so that the driver may begin with a program before its content is there.
export function programMaterial(shape: ProgramShape): THREE.RawShaderMaterial {
  const { parts, widths, network } = shape;
  const ofParts = kVectorsOfPart * parts;
  const vector = (n: number) => (network ? writtenVector(network, n) : `content[${ofParts + n}]`);
  const defines: Record<string, number | string> = { PARTS: parts, VECTORS: ofParts + vectorsOfNetwork(widths) };
  if (shape.surround) defines.SURROUND = '';
  if (shape.everywhere) defines.EVERYWHERE = '';
  if (shape.distancesOfBytes) defines.DISTANCES_OF_BYTES = '';
  if (shape.cuts) defines.CUTS = '';
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: kVertexShader,
    fragmentShader: [kFragmentHead, kDisplayConstants, atlasShader(shape.atlases), pathSource, marchSource, networkShader(widths, vector), kFragmentMain].join('\n'),
    defines,
    side: shape.everywhere ? THREE.DoubleSide : THREE.BackSide,
    transparent: true,
    depthWrite: false,
    depthTest: true,
    depthFunc: THREE.LessDepth,
    blending: THREE.CustomBlending,
    blendEquation: THREE.AddEquation,
    blendSrc: THREE.OneMinusDstAlphaFactor,
    blendDst: THREE.OneFactor,
    blendSrcAlpha: THREE.OneMinusDstAlphaFactor,
    blendDstAlpha: THREE.OneFactor,
    premultipliedAlpha: true,
    toneMapped: false,
  });
}

// Contents of one shape share a program, if they have none of their own. Drawn front to back, blended under what is there.
export function volumeMaterial(
  textures: ContentTextures, view: ViewUniforms, shape: ProgramShape, colours: { block: THREE.Color; level: THREE.Color },
): THREE.RawShaderMaterial {
  const material = programMaterial(shape);
  const group = new THREE.UniformsGroup();
  group.setName('Content');
  group.add(new THREE.Uniform(textures.numbers));
  material.uniforms = {
    ...view,
    hiddenBoxes: shape.surround ? view.hiddenBoxesOfSurround : view.hiddenBoxes,
    planesFirst: { value: textures.planesFirst },
    planesSecond: { value: textures.planesSecond },
    inTexture: {
      value: textures.voxelsFirst.map(({ image: { width, height, depth } }) => new THREE.Vector3(1 / width, 1 / height, 1 / depth)),
    },
    atlasDepth: { value: textures.voxelsFirst[0].image.depth },
    ...Object.fromEntries(textures.voxelsFirst.map((value, n) => [`voxelsFirst${n}`, { value }])),
    ...Object.fromEntries(textures.voxelsSecond.map((value, n) => [`voxelsSecond${n}`, { value }])),
    macroblocks: { value: textures.macroblocks },
    distances: { value: textures.distances },
    featureRange: { value: textures.ranges.features },
    densityRange: { value: textures.ranges.density },
    stepsPerTexel: { value: textures.stepsPerTexel },
    colourOfBlock: { value: colours.block },
    colourOfLevel: { value: colours.level },
  };
  material.uniformsGroups = [group];
  return material;
}
