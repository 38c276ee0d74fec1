// One invocation per pixel: blends a frame with the frames before it (temporal anti-aliasing): with their mean if the
// view has not changed, otherwise with what they showed at the same place, limited to the colours around the pixel.
// Source of the limits: Salvi 2016, "An Excursion in Temporal Supersampling".
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
KERNEL_ARGUMENTS(BlendFramesArguments)

vec4 frameAt(ViewArguments view, uint pixel) { return vec4(pointAt(view.colour, pixel), view.opacity.values[pixel]); }

// Sets `position` to where the previous image showed what this pixel shows; returns false if it did not.
bool previousPosition(BlendFramesArguments a, uint pixel, out vec2 position) {
  const vec3 direction = pointAt(a.view.directions, pixel);
  const float depth = a.view.depth.values[pixel];
  // The sky, at depth 0, is infinitely far away.
  const vec3 here = depth > 0 ? direction * (depth / direction.z) : direction;
  vec3 there;
  for (uint row = 0; row < 3; ++row) {
    there[row] = dot(vec3(a.previousFromCamera[3 * row], a.previousFromCamera[3 * row + 1],
                          a.previousFromCamera[3 * row + 2]), here);
    if (depth > 0) there[row] += a.shift[row];
  }
  position = vec2(a.focal[0], a.focal[1]) * there.xy / there.z + vec2(a.centre[0], a.centre[1]);
  return there.z > 0 && all(greaterThanEqual(position, vec2(0))) &&
         all(lessThanEqual(position, vec2(a.view.width, a.view.height)));
}

// Weights of four pixels in a row for a place between the middle ones (Catmull and Rom): mixing two of them would blur
// the history more with each frame.
vec4 cubicWeights(float t) {
  return vec4(t * (t * (1 - 0.5 * t) - 0.5), 1 + t * t * (1.5 * t - 2.5), t * (0.5 + t * (2 - 1.5 * t)),
              t * t * (0.5 * t - 0.5));
}

// Mixes the history at a position, in pixels; returns the number of frames of the nearest pixel.
float mixHistory(BlendFramesArguments a, vec2 position, out vec4 mixed) {
  const ivec2 last = ivec2(a.view.width - 1, a.view.height - 1);
  const vec2 at = clamp(position - 0.5, vec2(0), vec2(last));
  const ivec2 first = ivec2(at);
  const vec4 ofColumns = cubicWeights(at.x - first.x), ofRows = cubicWeights(at.y - first.y);
  mixed = vec4(0);
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      const ivec2 texel = clamp(first + ivec2(i - 1, j - 1), ivec2(0), last);
      const uint number = 5 * uint(texel.y * int(a.view.width) + texel.x);
      for (uint c = 0; c < 4; ++c) mixed[c] += ofColumns[i] * ofRows[j] * a.history.values[number + c];
    }
  }
  const ivec2 nearest = min(ivec2(at + 0.5), last);
  return a.history.values[5 * uint(nearest.y * int(a.view.width) + nearest.x) + 4];
}

void main() {
  BlendFramesArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  const vec4 frame = frameAt(a.view, pixel);
  vec4 history = frame;
  float frames = 0;
  const bool isNoisy = !IS_SET(a.noise) || a.noise.values[pixel] > 0;
  if (IS_SET(a.history) && isNoisy) {
    vec2 position;
    if (a.restingFrames != 0) {
      for (uint c = 0; c < 4; ++c) history[c] = a.history.values[5 * pixel + c];
      // What was blended while the camera moved counts as one frame.
      frames = min(a.history.values[5 * pixel + 4], float(a.restingFrames));
    } else if (previousPosition(a, pixel, position)) {
      frames = min(mixHistory(a, position, history), 1 / a.smallestWeight - 1);
      vec4 low = frame, high = frame, sum = vec4(0), squares = vec4(0);
      float count = 0;
      const ivec2 at = ivec2(gl_GlobalInvocationID.xy), last = ivec2(a.view.width - 1, a.view.height - 1);
      for (int y = max(at.y - 1, 0); y <= min(at.y + 1, last.y); ++y) {
        for (int x = max(at.x - 1, 0); x <= min(at.x + 1, last.x); ++x) {
          const vec4 beside = frameAt(a.view, uint(y) * a.view.width + uint(x));
          low = min(low, beside);
          high = max(high, beside);
          sum += beside;
          squares += beside * beside;
          ++count;
        }
      }
      const vec4 mean = sum / count, reach = a.largestDeviation * sqrt(max(squares / count - mean * mean, 0));
      history = clamp(history, max(low, mean - reach), min(high, mean + reach));
    }
  }
  const vec4 blended = mix(history, frame, 1 / (frames + 1));
  for (uint c = 0; c < 4; ++c) a.blended.values[5 * pixel + c] = blended[c];
  a.blended.values[5 * pixel + 4] = frames + 1;
}
