// The shader that draws one content: what it adds to each pixel, and how far away that is (docs/tile-format.md, section 4). What
// depends on the representation are its ProgramPieces.
import * as THREE from 'three';
import marchPartSource from '../../../shaders/raymarch/march_part.glsl?raw';
import pathSource from '../../../shaders/lib/domain_path.glsl?raw';
import placeSource from '../../../shaders/raymarch/part_place.glsl?raw';
import { kDisplayConstants } from '../draw/display-modes';
import { kMostHiddenBoxes } from '../draw/hidden-boxes';
import { kFarAway } from '../draw/scene-drawer';
import type { ContentTextures } from './content-textures';

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
  display: { value: number }; // of the drawer's modes
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
precision highp usampler3D;
precision highp usampler2DArray;
layout(location = 1) out vec4 distanceAndOpacity;
layout(std140) uniform Content { vec4 content[VECTORS]; };
uniform sampler2D opaqueDepth;
uniform float minTransmittance, sceneNear, visibility;
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
    vec2 owned = ownedRange(part.place, o, d, whole);
    if (owned.x < owned.y) marchShown(part, o, d, owned, sum);
    if (sum.transmittance < minTransmittance) break;
  }
#endif
  float opacity = 1.0 - sum.transmittance;
  if (opacity <= 0.0) discard;
  // What hides half is where the surface is, whatever shines through it from far behind, and whatever haze is before it.
  float surface = sum.median > 0.0 ? sum.median : sum.depth / opacity;
  float seen = 1.0;
#ifdef EVERYWHERE
  vec3 x = o + surface * d;
  seen = 1.0 - smoothstep(0.1 * visibility, visibility, length(max(max(sceneLow - x, x - sceneHigh), 0.0)));
#endif
  writeContent(sum, d, opacity, seen);
  float hides = clamp(4.0 * seen * opacity - 1.0, 0.0, 1.0);
#ifdef DISTANCES_OF_BYTES
  surface /= surface + 1.0;
#else
  surface = min(surface, 60000.0);  // half floats end at 65504
#endif
  distanceAndOpacity = vec4(surface * hides, 0.0, 0.0, hides);
}`;

// What a program depends on beside the content.
export interface ProgramPlace {
  surround: boolean;
  everywhere: boolean; // fills the picture, as it owns what lies beyond any box
  distancesOfBytes: boolean; // the target's are, from 0 for no distance to 255 for the farthest
  cuts: boolean; // knows hidden boxes, which costs a hundredth even where there are none
}

// What of a representation goes into a program.
export interface ProgramPieces {
  parts: number;
  vectors: number; // of `content`
  defines: Record<string, number | string>;
  // Declares outputs at locations but 1 and uniforms, and defines Part, partOf, marchSegment (shaders/lib) and
  // `void writeContent(Composite sum, vec3 d, float opacity, float seen)`: what is seen of a ray's sum.
  source: string;
}

// The same for all contents that share a program.
export function keyOf(pieces: ProgramPieces, place: ProgramPlace): string {
  return JSON.stringify([pieces, place]);
}

// Without uniforms: so that the driver may begin with a program before its content is there.
export function programMaterial(pieces: ProgramPieces, place: ProgramPlace): THREE.RawShaderMaterial {
  const defines: Record<string, number | string> = { ...pieces.defines, PARTS: pieces.parts, VECTORS: pieces.vectors };
  if (place.surround) defines.SURROUND = '';
  if (place.everywhere) defines.EVERYWHERE = '';
  if (place.distancesOfBytes) defines.DISTANCES_OF_BYTES = '';
  if (place.cuts) defines.CUTS = '';
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: kVertexShader,
    fragmentShader: [kFragmentHead, kDisplayConstants, pathSource, placeSource, pieces.source, marchPartSource, kFragmentMain].join('\n'),
    defines,
    side: place.everywhere ? THREE.DoubleSide : THREE.BackSide,
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

// Contents of one shape share a program, if they have none of their own. Drawn front to back, blended under what is there. Of its
// uniforms the representation's, colourOfBlock and colourOfLevel are still to be added.
export function contentMaterial(
  textures: ContentTextures, view: ViewUniforms, pieces: ProgramPieces, place: ProgramPlace,
): THREE.RawShaderMaterial {
  const material = programMaterial(pieces, place);
  const group = new THREE.UniformsGroup();
  group.setName('Content');
  group.add(new THREE.Uniform(textures.numbers));
  material.uniforms = {
    ...view,
    ...textures.uniforms(),
    hiddenBoxes: place.surround ? view.hiddenBoxesOfSurround : view.hiddenBoxes,
  };
  material.uniformsGroups = [group];
  return material;
}
