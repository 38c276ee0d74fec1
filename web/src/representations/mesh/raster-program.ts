// The program that draws the triangles of a part into the images that the passes read (passes.ts): which part is visible
// in each pixel, at which distance, and its features there. Half-transparent triangles are drawn in a pixel if their
// opacity is above its threshold (shaders/lib/dither_threshold.glsl), or, of solid surfaces, if it is at least one half.
// Places are relative to the picture's reference point, so that single precision suffices.
import * as THREE from 'three';
import ditherSource from '../../../../shaders/lib/dither_threshold.glsl?raw';
import { displayConstants } from '../../draw/display-modes';
import { kMaxHiddenBoxes } from '../../draw/hidden-boxes';
import { kMeshModes } from './mesh-modes';

export const kModeConstants = displayConstants(kMeshModes);
export const kHalfTransparent = 0x80000000; // set in the number of a part where its opacity is below 1

const kVertexShader = `
in vec3 position;  // the numbers of a corner
uniform mat4 clipFromReference;
uniform vec3 partOrigin;  // relative to the reference point
uniform float partStep;
out vec2 place;  // column and row in the patch, 0 to 1
out vec3 fromReference;
flat out int patchNumber;
void main() {
  int corner = gl_VertexID & 3;
  patchNumber = gl_VertexID >> 2;
  place = vec2(corner & 1, corner >> 1);
  fromReference = partOrigin + partStep * position;
  gl_Position = clipFromReference * vec4(fromReference, 1.0);
}`;

const kFragmentShader = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
in vec2 place;
in vec3 fromReference;
flat in int patchNumber;
#ifdef SOLID
layout(location = 0) out uvec2 visible;  // number of the part, counted from 1; bits of the distance
#elif defined(LAYERS)
layout(location = 0) out vec4 layer;
#else
layout(location = 0) out vec4 featuresFirst;
layout(location = 1) out vec4 featuresSecond;
layout(location = 2) out uvec2 visible;
#endif
uniform sampler2DArray featureTexels, opacityTexels;
uniform vec3 patchLayout;  // texels along an edge of a patch, patches in a row, number of the part
uniform uint layers;  // number of the first triangle's layer (ditherThreshold)
uniform sampler2D opaqueDepth;
uniform vec4 part;
uniform vec2 jitter;  // of the places that pixels show, in pixels
uniform mat3 origin, ray;
uniform vec4 depthRow, wRow;  // of the camera's projection
uniform float sceneNear, visibility;
uniform vec3 sceneLow, sceneHigh, withinLow, withinHigh;
uniform bool isBackground, withinBox;
uniform int display;
uniform uint frame;
uniform vec2 share;  // of the pixels, in which the part is drawn
uniform int hiddenBoxes;
uniform mat4 boxFromReference[${2 * kMaxHiddenBoxes}];

const float kSceneEnd = 1e6;
const uint kFadeLayer = 0xfadeu;  // of the thresholds between contents that fade into each other

// Returns the distance from which on the background block is seen.
float behindBox(vec3 o, vec3 d) {
  vec3 a = (sceneLow - o) / d, b = (sceneHigh - o) / d;
  vec3 first = min(a, b), last = max(a, b);
  float from = max(max(first.x, first.y), max(first.z, sceneNear)), to = min(min(last.x, last.y), min(last.z, kSceneEnd));
  return from < to ? to : sceneNear;
}

bool isHidden(vec3 x) {
  for (int n = 0; n < hiddenBoxes; ++n) {
    vec3 inBox = abs((boxFromReference[n] * vec4(x, 1.0)).xyz);
    if (max(inBox.x, max(inBox.y, inBox.z)) <= 0.5) return true;
  }
  return false;
}

void main() {
  vec2 ndc = 2.0 * (gl_FragCoord.xy + jitter - part.xy) / part.zw - 1.0;
  vec3 o = origin * vec3(ndc, 1.0), d = normalize(ray * vec3(ndc, 1.0));
  float distance = dot(fromReference - o, d);
  if (!(distance > (isBackground ? behindBox(o, d) : sceneNear) && distance < kSceneEnd)) discard;
  if (any(lessThan(fromReference, withinLow)) || any(greaterThanEqual(fromReference, withinHigh))) discard;
  float depth = dot(depthRow, vec4(fromReference, 1.0)) / dot(wRow, vec4(fromReference, 1.0));
  float opaque = texelFetch(opaqueDepth, min(ivec2(gl_FragCoord.xy), textureSize(opaqueDepth, 0) - 1), 0).r;
  if (opaque < 1.0 && 0.5 + 0.5 * depth > opaque) discard;
  if (hiddenBoxes > 0 && isHidden(fromReference)) discard;
  int across = int(patchLayout.y);
  vec2 texel = patchLayout.x * vec2(patchNumber % across, patchNumber / across) + 0.5 + (patchLayout.x - 1.0) * clamp(place, 0.0, 1.0);
  vec2 at = texel / vec2(textureSize(opacityTexels, 0).xy);
  float opacity = textureLod(opacityTexels, vec3(at, 0.0), 0.0).r;
  float outside = length(max(max(sceneLow - fromReference, fromReference - sceneHigh), 0.0));
  if (withinBox && outside > 0.0) discard;
  opacity *= 1.0 - smoothstep(0.1 * visibility, visibility, outside);
#ifdef SOLID
  if (opacity < 0.5) discard;
  visible = uvec2(uint(patchLayout.z), floatBitsToUint(distance));
#elif defined(LAYERS)
  if (opacity <= 0.0) discard;
  layer = vec4(vec3(1.0 / 16.0), 1.0);
#else
  bool isSecond = place.x + place.y > 1.0;
  uint number = uint(patchLayout.z), layer = layers + 2u * uint(patchNumber) + (isSecond ? 1u : 0u);
  float threshold = ditherThreshold(uvec2(gl_FragCoord.xy - part.xy), frame, layer);
#ifdef INSPECTED
  if (display == kShowAlpha) threshold = 0.0;
  if (display == kShowTriangles) threshold = 0.5;
#endif
  if (opacity <= threshold) discard;
  bool isFading = share.y - share.x < 1.0;
  if (isFading) {
    float between = ditherThreshold(uvec2(gl_FragCoord.xy - part.xy), frame, kFadeLayer);
    if (between < share.x || between >= share.y) discard;
  }
  visible = uvec2(number | (opacity < 1.0 || isFading ? ${kHalfTransparent}u : 0u), floatBitsToUint(distance));
#ifdef BLOCK_TEXTURES
  featuresFirst = vec4(textureLod(featureTexels, vec3(at, 0.0), 0.0).rg, textureLod(featureTexels, vec3(at, 1.0), 0.0).rg);
  featuresSecond = vec4(textureLod(featureTexels, vec3(at, 2.0), 0.0).rg, textureLod(featureTexels, vec3(at, 3.0), 0.0).rg);
#else
  featuresFirst = textureLod(featureTexels, vec3(at, 0.0), 0.0);
  featuresSecond = textureLod(featureTexels, vec3(at, 1.0), 0.0);
#endif
#ifdef INSPECTED
  if (display == kShowAlpha) featuresFirst.rgb = vec3(opacity);
  if (display == kShowTriangles) {
    vec3 normal = normalize(cross(dFdx(fromReference), dFdy(fromReference)));
    float hue = fract(0.618034 * float(2 * patchNumber + (isSecond ? 1 : 0)));
    vec3 tint = clamp(abs(fract(hue + vec3(0.0, 0.667, 0.333)) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
    featuresFirst.rgb = mix(vec3(0.75), tint, 0.3) * (0.25 + 0.75 * abs(dot(normal, d)));
  }
#endif
#endif
}`;

// `inspected`: dithered, as a display mode shows them.
export type RasterKind = 'dithered' | 'inspected' | 'solid' | 'layers';

// Returns the material of a part, without uniforms. Programs depend on the kind and the form of textures alone.
export function rasterMaterial(kind: RasterKind, isCompressed: boolean): THREE.RawShaderMaterial {
  const defines: Record<string, string> = {};
  if (kind === 'solid') defines.SOLID = '';
  if (kind === 'inspected') defines.INSPECTED = '';
  if (kind === 'layers') defines.LAYERS = '';
  if (isCompressed) defines.BLOCK_TEXTURES = '';
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: kVertexShader,
    // The shared source declares its integers without precision.
    fragmentShader: ['precision highp float;\nprecision highp int;', kModeConstants, ditherSource, kFragmentShader].join('\n'),
    defines,
    side: THREE.DoubleSide,
    blending: kind === 'layers' ? THREE.CustomBlending : THREE.NoBlending,
    blendSrc: THREE.OneFactor, blendDst: THREE.OneFactor,
    depthTest: kind !== 'layers', depthWrite: kind !== 'layers', depthFunc: THREE.LessDepth, // of equal hits, the first counts
    toneMapped: false,
  });
}
