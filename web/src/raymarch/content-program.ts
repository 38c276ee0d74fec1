// The shader that draws one content: its colour in each pixel and the distance of its surface (docs/tile-format.md,
// section 4). ProgramPieces supply the parts that depend on the representation.
import * as THREE from 'three';
import marchPartSource from '../../../shaders/raymarch/march_part.glsl?raw';
import pathSource from '../../../shaders/lib/domain_path.glsl?raw';
import placeSource from '../../../shaders/raymarch/part_place.glsl?raw';
import { kDisplayConstants } from '../draw/display-modes';
import { kMaxHiddenBoxes } from '../draw/hidden-boxes';
import { kFarAway } from '../draw/scene-drawer';
import type { ContentTextures } from './content-textures';

// Uniforms shared by all contents of a picture. Lengths are in scene units; `part`, `origin`, `ray` and `sceneFromClip`
// are those of Picture.
export interface ViewUniforms {
  resolution: { value: THREE.Vector2 }; // of the target, in pixels
  part: { value: THREE.Vector4 };
  origin: { value: THREE.Matrix3 };
  ray: { value: THREE.Matrix3 };
  sceneLow: { value: THREE.Vector3 };
  sceneHigh: { value: THREE.Vector3 };
  sceneNear: { value: number };
  visibility: { value: number }; // visibility range beyond the scene's box, above 0
  withinLow: { value: THREE.Vector3 }; // the box in which the next content is drawn; ignored for background blocks
  withinHigh: { value: THREE.Vector3 };
  minTransmittance: { value: number }; // rays end below this transmittance; 0: never
  opaqueDepth: { value: THREE.Texture | null }; // depth buffer of the opaque objects; 1 where there are none
  sceneFromClip: { value: THREE.Matrix4 };
  display: { value: number }; // index in the drawer's modes
  boxFromScene: { value: THREE.Matrix4[] }; // boxes in which nothing is drawn, with |x| <= 1/2 inside each
  hiddenBoxes: { value: number }; // number of boxes that apply to contents other than the background block
  hiddenBoxesOfBackgroundBlock: { value: number }; // number of boxes that apply to the background block
  withinBox: { value: boolean }; // nothing outside the scene's box is drawn
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
    boxFromScene: { value: Array.from({ length: 2 * kMaxHiddenBoxes }, () => new THREE.Matrix4()) },
    hiddenBoxes: { value: 0 },
    hiddenBoxesOfBackgroundBlock: { value: 0 },
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
  gl_Position.z = 0.0;  // no clip plane of the camera cuts it off
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
uniform mat4 boxFromScene[${2 * kMaxHiddenBoxes}];
uniform bool withinBox;
#else
const bool withinBox = false;
#endif
`;

const kFragmentMain = `
const float kSceneEnd = 1e6;

// Returns the distance at which opaque objects end the ray.
float opaqueDistance(vec2 ndc, vec3 o, vec3 d) {
  float depth = texture(opaqueDepth, gl_FragCoord.xy / resolution).r;
  if (depth >= 1.0) return kSceneEnd;
  vec4 x = sceneFromClip * vec4(ndc, 2.0 * depth - 1.0, 1.0);
  return dot(x.xyz / x.w - o, d);
}

// Marches the pieces of range that lie in no hidden box. Boxes are cut out of rays, along which lengths are in scene
// units even where space is contracted.
#ifdef CUTS
void marchShown(Part part, vec3 o, vec3 d, vec2 range, inout Composite sum) {
  float t = range.x;
  int guard = 0;
  do {
    float exit = t, next = range.y;  // exit: end of the boxes that contain t; next: start of the nearest box after t
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
  } while (t < range.y && sum.transmittance >= minTransmittance && ++guard < ${4 * kMaxHiddenBoxes + 1});
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
#ifdef BACKGROUND_BLOCK
  vec2 behind = vec2(meetsBox ? box.y : sceneNear, far);
  if (behind.x < behind.y) marchShown(fetchPart(0), o, d, behind, sum);
#else
  vec2 whole = clipToBox(o, d, withinLow, withinHigh, vec2(meetsBox ? box.x : sceneNear, far));
  for (int n = 0; n < PARTS; ++n) {
    Part part = fetchPart(n);
    vec2 owned = ownedRange(part.place, o, d, whole);
    if (owned.x < owned.y) marchShown(part, o, d, owned, sum);
    if (sum.transmittance < minTransmittance) break;
  }
#endif
  float opacity = 1.0 - sum.transmittance;
  if (opacity <= 0.0) discard;
  // The surface is where half of the light is absorbed, regardless of what shines through from far behind and of haze
  // in front.
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

// What a program depends on besides the content.
export interface ProgramPlace {
  backgroundBlock: boolean;
  everywhere: boolean; // fills the screen, as its content owns space beyond any box
  distancesOfBytes: boolean; // distances are stored as bytes, from 0 for distance 0 to 255 for infinity
  cuts: boolean; // supports hidden boxes, which costs 1 % even if there are none
}

// The parts of a program that depend on the representation.
export interface ProgramPieces {
  parts: number;
  vectors: number; // size of `content`
  defines: Record<string, number | string>;
  // Declares outputs (at locations other than 1) and uniforms, and defines Part, fetchPart, marchSegment (shaders/lib)
  // and `void writeContent(Composite sum, vec3 d, float opacity, float seen)`, where `seen` is the visible share of the
  // ray's sum.
  source: string;
}

// Equal for all contents that share a program.
export function programKey(pieces: ProgramPieces, place: ProgramPlace): string {
  return JSON.stringify([pieces, place]);
}

// The material has no uniforms, so that the driver can start to compile the program before the content is loaded.
export function programMaterial(pieces: ProgramPieces, place: ProgramPlace): THREE.RawShaderMaterial {
  const defines: Record<string, number | string> = { ...pieces.defines, PARTS: pieces.parts, VECTORS: pieces.vectors };
  if (place.backgroundBlock) defines.BACKGROUND_BLOCK = '';
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

// Creates the material of a content. Contents with the same layout share a program unless they have their own. Contents
// are drawn front to back, each blended under the earlier ones. The caller adds the uniforms of the representation,
// colourOfBlock and colourOfLevel.
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
    hiddenBoxes: place.backgroundBlock ? view.hiddenBoxesOfBackgroundBlock : view.hiddenBoxes,
  };
  material.uniformsGroups = [group];
  return material;
}
