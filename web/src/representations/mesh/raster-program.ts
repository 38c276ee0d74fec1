// The program that draws the triangles of a part into the images that the passes read (passes.ts): which part is visible
// in each pixel, at which distance, and which place of its textures. Features are sampled later, once per pixel, as most
// fragments are not visible in the end. Half-transparent triangles are drawn in a pixel if their
// opacity is above its threshold (shaders/lib/dither_threshold.glsl), or, of solid surfaces, if it is at least one half.
// Places are relative to the picture's reference point, so that single precision suffices.
import * as THREE from 'three';
import ditherSource from '../../../../shaders/lib/dither_threshold.glsl?raw';
import { displayConstants } from '../../draw/display-modes';
import { kMaxHiddenBoxes } from '../../draw/hidden-boxes';
import { kMeshModes } from './mesh-modes';

export const kModeConstants = displayConstants(kMeshModes);
export const kHalfTransparent = 0x80000000; // set in the number of a part where its opacity is below 1

// Thresholds are those of shaders/lib/dither_threshold.glsl, for other pixels and layers: what depends on the triangle is
// computed once for each of its vertices, and what remains are half of the operations. What fragments need of uniforms
// comes from the vertices, too, as drivers for the CPU read uniforms slowly.
const kVertexShader = `
in vec3 position;  // the numbers of a corner
uniform mat4 clipFromReference;
uniform vec3 partOrigin;  // relative to the reference point
uniform float partStep;
uniform vec2 patchLayout;  // texels along an edge of a patch, patches in a row
uniform vec2 texelSize;  // as a share of the textures
uniform uint firstLayer, frame, partNumber;
uniform vec4 part;
uniform float sceneNear;
out vec2 place;  // in the textures
out vec3 fromReference;
flat out uvec4 numbers;  // x: seed of the layer in pixel (0, 0); y: the part; z: the frame, 0 to 63; w: bits of sceneNear
#ifdef INSPECTED
flat out uint triangle;
#endif
void main() {
  int corner = gl_VertexID & 3, patchNumber = gl_VertexID >> 2;
  // Floating-point numbers suffice for the division, as patches are fewer than 2^18.
  float row = floor((float(patchNumber) + 0.5) / patchLayout.y);
  vec2 first = patchLayout.x * vec2(float(patchNumber) - patchLayout.y * row, row) + 0.5;
  place = texelSize * (first + (patchLayout.x - 1.0) * vec2(corner & 1, corner >> 1));
  // The last vertex of a triangle counts: corner 2 of the first triangle, 1 of the second one.
  uint number = 2u * uint(patchNumber) + (corner == 1 ? 1u : 0u);
  // Pixels count from the corner of the picture.
  uint seed = scatterBits((firstLayer + number) ^ scatterBits(frame >> 6)) - uint(part.x) - (uint(part.y) << 16);
  numbers = uvec4(seed, partNumber, frame & 63u, floatBitsToUint(sceneNear));
#ifdef INSPECTED
  triangle = number;
#endif
  fromReference = partOrigin + partStep * position;
  gl_Position = clipFromReference * vec4(fromReference, 1.0);
}`;

// Drivers for the CPU evaluate all branches and read uniforms slowly, so what is seldom needed is in a program of its own
// (GENERAL): hidden boxes, limits of a content, fading, parallel projections. Other objects are in the depth buffer before
// triangles are drawn (passes.ts).
const kFragmentShader = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
in vec2 place;
in vec3 fromReference;
flat in uvec4 numbers;
#ifdef INSPECTED
flat in uint triangle;
#endif
#ifdef SOLID
layout(location = 0) out uvec2 visible;  // number of the part, counted from 1; bits of the distance
#elif defined(LAYERS)
layout(location = 0) out vec4 added;
#else
// Number of the part, counted from 1, with kHalfTransparent; bits of the distance; of the place in the textures, of which
// the last is replaced by the colour that a display mode shows.
layout(location = 0) out uvec4 visible;
#endif
uniform sampler2DArray opacityTexels;
uniform vec3 sceneLow, sceneHigh;
const float kSceneEnd = 1e6;

// Returns the distance from which on the background block is seen.
float behindBox(vec3 o, vec3 d) {
  vec3 a = (sceneLow - o) / d, b = (sceneHigh - o) / d;
  vec3 first = min(a, b), last = max(a, b);
  float sceneNear = uintBitsToFloat(numbers.w), from = max(max(first.x, first.y), max(first.z, sceneNear)), to = min(min(last.x, last.y), min(last.z, kSceneEnd));
  return from < to ? to : sceneNear;
}

#ifdef GENERAL
uniform vec4 part;
uniform uint frame;
uniform vec2 jitter;  // of the places that pixels show, in pixels
uniform mat3 origin, ray;
uniform float visibility;
uniform vec3 withinLow, withinHigh;
uniform bool withinBox;
uniform int display;
uniform vec2 share;  // of the pixels, in which the part is drawn
uniform int hiddenBoxes;
uniform mat4 boxFromReference[${2 * kMaxHiddenBoxes}];
const uint kFadeLayer = 0xfadeu;  // of the thresholds between contents that fade into each other

bool isHidden(vec3 x) {
  for (int n = 0; n < hiddenBoxes; ++n) {
    vec3 inBox = abs((boxFromReference[n] * vec4(x, 1.0)).xyz);
    if (max(inBox.x, max(inBox.y, inBox.z)) <= 0.5) return true;
  }
  return false;
}
#endif

uint packColour(vec3 colour) {
  uvec3 bytes = uvec3(255.0 * clamp(colour, 0.0, 1.0) + 0.5);
  return bytes.r | bytes.g << 8 | bytes.b << 16;
}

void main() {
#ifdef GENERAL
  vec2 ndc = 2.0 * (gl_FragCoord.xy + jitter - part.xy) / part.zw - 1.0;
  vec3 o = origin * vec3(ndc, 1.0), d = normalize(ray * vec3(ndc, 1.0));
  float distance = dot(fromReference - o, d);
#else
  float distance = length(fromReference);  // the reference point is the eye
  vec3 o = vec3(0.0), d = fromReference / distance;
#endif
#ifdef BACKGROUND
  float from = behindBox(o, d);
#else
  float from = uintBitsToFloat(numbers.w);
#endif
  if (!(distance > from && distance < kSceneEnd)) discard;
  float opacity = textureLod(opacityTexels, vec3(place, 0.0), 0.0).r;
#ifdef GENERAL
  if (any(lessThan(fromReference, withinLow)) || any(greaterThanEqual(fromReference, withinHigh))) discard;
  if (hiddenBoxes > 0 && isHidden(fromReference)) discard;
  float outside = length(max(max(sceneLow - fromReference, fromReference - sceneHigh), 0.0));
  if (withinBox && outside > 0.0) discard;
  opacity *= 1.0 - smoothstep(0.1 * visibility, visibility, outside);
#endif
#ifdef SOLID
  if (opacity < 0.5) discard;
  visible = uvec2(numbers.y, floatBitsToUint(distance));
#elif defined(LAYERS)
  if (opacity <= 0.0) discard;
  added = vec4(vec3(1.0 / 16.0), 1.0);
#else
  uvec2 pixel = uvec2(gl_FragCoord.xy);
  float threshold = ditherThreshold(uvec2(numbers.x + pixel.x + (pixel.y << 16), 0), numbers.z & 63u, 0u);
#ifdef INSPECTED
  if (display == kShowAlpha) threshold = 0.0;
  if (display == kShowTriangles) threshold = 0.5;
#endif
  if (opacity <= threshold) discard;
  bool isHalfTransparent = opacity < 1.0;
#ifdef GENERAL
  if (share.y - share.x < 1.0) {
    float between = ditherThreshold(pixel - uvec2(part.xy), frame, kFadeLayer);
    if (between < share.x || between >= share.y) discard;
    isHalfTransparent = true;
  }
#endif
  visible.x = isHalfTransparent ? numbers.y | ${kHalfTransparent}u : numbers.y;
  visible.y = floatBitsToUint(distance);
  visible.zw = floatBitsToUint(place);
#ifdef INSPECTED
  if (display == kShowAlpha) visible.w = packColour(vec3(opacity));
  if (display == kShowTriangles) {
    vec3 normal = normalize(cross(dFdx(fromReference), dFdy(fromReference)));
    float hue = fract(0.618034 * float(triangle));
    vec3 tint = clamp(abs(fract(hue + vec3(0.0, 0.667, 0.333)) * 6.0 - 3.0) - 1.0, 0.0, 1.0);
    visible.w = packColour(mix(vec3(0.75), tint, 0.3) * (0.25 + 0.75 * abs(dot(normal, d))));
  }
#endif
#endif
}`;

// `inspected`: dithered, as a display mode shows them.
export type RasterKind = 'dithered' | 'inspected' | 'solid' | 'layers';

// What a program of triangles depends on.
export interface RasterForm {
  kind: RasterKind;
  isBackground: boolean;
  isGeneral: boolean; // otherwise, nothing of GENERAL is needed; always for 'inspected'
}

// Returns the material of a part, without uniforms.
export function rasterMaterial({ kind, isBackground, isGeneral }: RasterForm): THREE.RawShaderMaterial {
  const defines: Record<string, string> = {};
  if (kind === 'solid') defines.SOLID = '';
  if (kind === 'inspected') defines.INSPECTED = '';
  if (kind === 'layers') defines.LAYERS = '';
  if (isBackground) defines.BACKGROUND = '';
  if (isGeneral) defines.GENERAL = '';
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    // The shared source declares its integers without precision.
    vertexShader: ['precision highp float;\nprecision highp int;', ditherSource, kVertexShader].join('\n'),
    fragmentShader: ['precision highp float;\nprecision highp int;', kModeConstants, ditherSource, kFragmentShader].join('\n'),
    defines,
    side: THREE.DoubleSide,
    blending: kind === 'layers' ? THREE.CustomBlending : THREE.NoBlending,
    blendSrc: THREE.OneFactor, blendDst: THREE.OneFactor,
    depthTest: true, depthWrite: kind !== 'layers', depthFunc: THREE.LessDepth, // of equal hits, the first counts
    toneMapped: false,
  });
}
