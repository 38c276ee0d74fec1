// The passes over a picture, apart from those of part-colours.ts: the depths of other objects before triangles are drawn;
// then the sky, and the blending with the frames before.
import * as THREE from 'three';
import { kScreenVertexShader } from '../../draw/screen-triangle';

// Opacity of a pixel that shows something half-transparent, before frames are blended; it stands for 1.
export const kNoisyOpacity = '(254.0 / 255.0)';

export const kPassHead = `
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp usampler2D;
`;

// For vertex shaders: what is linear in a picture is interpolated, as drivers for the CPU read uniforms slowly.
export const kRayOfVertexSource = `
precision highp float;
precision highp int;
uniform vec4 part;
uniform vec2 jitter;
uniform mat3 origin, ray;
vec3 ndcOfVertex(vec2 position) {
  return vec3(position + 2.0 * jitter / part.zw, 1.0);
}`;

// `rayDirection` is not normalised.
const kBlendVertexShader = `
${kRayOfVertexSource}
in vec3 position;
uniform mat4 previousClip;  // of places relative to the reference point, in the previous picture
out vec3 rayDirection;
out vec4 previousOrigin, previousDirection;
void main() {
  vec3 ndc = ndcOfVertex(position.xy);
  rayDirection = ray * ndc;
  previousOrigin = previousClip * vec4(origin * ndc, 1.0);
  previousDirection = previousClip * vec4(rayDirection, 0.0);
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

export function passMaterial(
  fragmentShader: string, uniforms: Record<string, THREE.IUniform>, vertexShader = kScreenVertexShader,
): THREE.RawShaderMaterial {
  return new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3, vertexShader, fragmentShader, uniforms,
    depthTest: false, depthWrite: false, blending: THREE.NoBlending, toneMapped: false,
  });
}

// Fills the depth buffer with the depths of other objects, for the projection that triangles are drawn with: a pixel of
// `opaqueDepth`, at depth z and thus at distance t along its ray, is at another depth there. So the driver skips triangles
// behind objects before it runs their program.
const kObjectsVertexShader = `
${kRayOfVertexSource}
in vec3 position;
uniform mat4 clipFromReference;  // of the triangles; its last row is that of the camera's projection
uniform vec4 depthRow, wRow;  // of the camera's projection
out vec3 start, slope;  // of a ray: both depths before the division, and what divides them
void main() {
  vec3 ndc = ndcOfVertex(position.xy);
  vec4 o = vec4(origin * ndc, 1.0), d = vec4(ray * ndc, 0.0);
  start = vec3(dot(depthRow, o), (clipFromReference * o).z, dot(wRow, o));
  slope = vec3(dot(depthRow, d), (clipFromReference * d).z, dot(wRow, d));
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;

const kObjectsShader = `${kPassHead}
in vec3 start, slope;
uniform sampler2D opaqueDepth;
void main() {
  float opaque = texelFetch(opaqueDepth, min(ivec2(gl_FragCoord.xy), textureSize(opaqueDepth, 0) - 1), 0).r;
  float z = 2.0 * opaque - 1.0, t = (z * start.z - start.x) / (slope.x - z * slope.z);
  vec3 place = start + t * slope;
  gl_FragDepth = opaque < 1.0 ? clamp(0.5 + 0.5 * place.y / place.z, 0.0, 1.0) : 1.0;
}`;

export function objectsMaterial(uniforms: Record<string, THREE.IUniform>): THREE.RawShaderMaterial {
  const material = passMaterial(kObjectsShader, uniforms, kObjectsVertexShader);
  return Object.assign(material, { depthTest: true, depthWrite: true, depthFunc: THREE.AlwaysDepth, colorWrite: false });
}

// Colours the pixels that show the sky: those that show no part.
export const kSkyShader = `${kPassHead}
in vec3 rayDirection;
out vec4 colour;
uniform sampler2D opaqueDepth, sky;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  if (texelFetch(opaqueDepth, min(at, textureSize(opaqueDepth, 0) - 1), 0).r < 1.0) discard;
  vec3 d = rayDirection, size = abs(d);
  int a = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  float along = d[a];
  int side = 2 * a + (along < 0.0 ? 1 : 0);
  vec2 place = 0.5 + 0.5 * vec2(d[(a + 1) % 3], d[(a + 2) % 3]) / abs(along);
  vec2 edge = vec2(textureSize(sky, 0)) / vec2(1.0, 6.0);
  vec2 texel = vec2(0.0, float(side) * edge.y) + 0.5 + (edge - 1.0) * place;
  colour = vec4(textureLod(sky, texel / vec2(textureSize(sky, 0)), 0.0).rgb, 1.0);
}`;

// Blends the frame with those before, and states the distance of the solid surface. The rules are those of
// shaders/representations/mesh/blend_frames.comp. Whether a pixel of a moving picture is noisy is seen from the pixels
// around it, as there is no list of its layers.
const kBlendShader = `${kPassHead}
in vec3 rayDirection;
in vec4 previousOrigin, previousDirection;
layout(location = 0) out vec4 colourAndOpacity;
layout(location = 1) out vec4 distanceAndOpacity;
uniform sampler2D decoded, history;
uniform usampler2D visible, solid;
uniform float weight;  // of this frame
uniform bool hasHistory, isResting;
uniform bool hasSurface;  // otherwise what is visible stands for the solid surface
uniform vec4 part, previousPart;
const float kLargestDeviation = 1.0;

// Weights of four pixels in a row for a place between the middle ones (Catmull and Rom).
vec4 cubicWeights(float t) {
  return vec4(t * (t * (1.0 - 0.5 * t) - 0.5), 1.0 + t * t * (1.5 * t - 2.5), t * (0.5 + t * (2.0 - 1.5 * t)),
              t * t * (0.5 * t - 0.5));
}

vec4 mixHistory(vec2 position) {
  vec2 low = previousPart.xy, high = previousPart.xy + previousPart.zw - 1.0;
  vec2 at = clamp(position - 0.5, low, high), first = floor(at);
  vec4 ofColumns = cubicWeights(at.x - first.x), ofRows = cubicWeights(at.y - first.y), sum = vec4(0.0);
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      vec2 texel = clamp(first + vec2(i - 1, j - 1), low, high);
      sum += ofColumns[i] * ofRows[j] * texelFetch(history, ivec2(texel), 0);
    }
  }
  return sum;
}

vec4 withoutNote(vec4 colour) {
  return vec4(colour.rgb, colour.a > 0.5 ? 1.0 : 0.0);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 frame = withoutNote(texelFetch(decoded, at, 0));
  colourAndOpacity = frame;
  if (hasHistory && isResting) {
    colourAndOpacity = mix(texelFetch(history, at, 0), frame, weight);
  } else if (hasHistory) {
    uvec2 seen = texelFetch(visible, at, 0).xy;
    vec4 low = frame, high = frame, sum = vec4(0.0), squares = vec4(0.0);
    bool isNoisy = false;
    ivec2 first = ivec2(part.xy), last = ivec2(part.xy + part.zw) - 1;
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        ivec2 beside = clamp(at + ivec2(i, j), first, last);
        vec4 noted = texelFetch(decoded, beside, 0), colour = withoutNote(noted);
        isNoisy = isNoisy || (noted.a > 0.5 && noted.a < 0.999);
        low = min(low, colour);
        high = max(high, colour);
        sum += colour;
        squares += colour * colour;
      }
    }
    // The sky is infinitely far away.
    vec4 clip = seen.x == 0u ? previousDirection : previousOrigin + uintBitsToFloat(seen.y) / length(rayDirection) * previousDirection;
    vec2 previous = clip.xy / clip.w;
    if (isNoisy && clip.w > 0.0 && max(abs(previous.x), abs(previous.y)) <= 1.0) {
      vec4 mean = sum / 9.0, reach = kLargestDeviation * sqrt(max(squares / 9.0 - mean * mean, 0.0));
      vec4 before = mixHistory(previousPart.xy + (0.5 + 0.5 * previous) * previousPart.zw);
      colourAndOpacity = mix(clamp(before, max(low, mean - reach), min(high, mean + reach)), frame, weight);
    }
  }
  uvec2 surface = hasSurface ? texelFetch(solid, at, 0).xy : texelFetch(visible, at, 0).xy;
  float distance = uintBitsToFloat(surface.y);
#ifdef DISTANCES_OF_BYTES
  distance /= distance + 1.0;
#elif defined(DISTANCES_OF_HALF_FLOATS)
  distance = min(distance, 60000.0);  // they end at 65504
#endif
  distanceAndOpacity = surface.x == 0u ? vec4(0.0) : vec4(distance, 0.0, 0.0, 1.0);
}`;

export function blendMaterial(uniforms: Record<string, THREE.IUniform>): THREE.RawShaderMaterial {
  return passMaterial(kBlendShader, uniforms, kBlendVertexShader);
}

export const kCopyShader = `${kPassHead}
out vec4 copied;
uniform sampler2D from;
void main() {
  copied = texelFetch(from, ivec2(gl_FragCoord.xy), 0);
}`;
