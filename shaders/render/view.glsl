// The pixels of a camera, and their rays.
// Reads: ViewArguments, pointAt(). Defines: pixelIndex(), and what view_rays.glsl defines.
#include "view_rays.glsl"

// Sets `pixel` to the index of this invocation's pixel; returns false outside the image.
bool pixelIndex(ViewArguments view, out uint pixel) {
  pixel = gl_GlobalInvocationID.y * view.width + gl_GlobalInvocationID.x;
  return gl_GlobalInvocationID.x < view.width && gl_GlobalInvocationID.y < view.height;
}
