// ExposureBackward: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_losses.h"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(ExposureArguments)

void main() {
  ExposureArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    float ofOpacity = 0;
    for (uint c = 0; c < 3; ++c) {
      const uint i = 3 * ray + c, gain = 3 * a.photoOfRay.values[ray] + c;
      const float gradient = a.exposed.values[i];
      if (IS_SET(a.background)) ofOpacity -= gradient * a.background.values[i];
      const float ofColour = gradient * exp2(a.logGains.values[gain]);
      addTo(a.logGainGradients, gain, ofColour * a.colours.values[i] * 0.6931471805599453);
      a.colourGradients.values[i] = ofColour;
    }
    if (IS_SET(a.background)) a.opacityGradients.values[ray] = ofOpacity;
  }
}
