// Exposure of photos: how much brighter each shows the scene than it is.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Per-photo exposure: exposed = colour · 2^(logGain[photo of ray]) + (1 - opacity) · background per channel, in the
// trained colour space. Colours are of the scene alone: what stands behind it is not exposed with it.
struct ExposureForward {
  Count rays;
  Slice<const float> colours;        // [rays][3]
  Slice<const float> opacity;        // [rays]; read only with a background
  Slice<const float> background;     // optional, [rays][3]; else black
  Slice<const uint32_t> photoOfRay;  // [rays]
  Slice<const float> logGains;       // [photos][3]
  Slice<float> exposed;              // [rays][3]
};
TESSERA_OPERATION(ExposureForward);

// Overwrites colourGradients and opacityGradients, adds to logGainGradients.
struct ExposureBackward {
  Count rays;
  Slice<const float> colours;
  Slice<const float> background;
  Slice<const uint32_t> photoOfRay;
  Slice<const float> logGains;
  Slice<const float> exposedGradients;  // [rays][3]
  Slice<float> colourGradients;         // [rays][3]; may be the same memory as exposedGradients
  Slice<float> opacityGradients;        // [rays]; with a background
  Slice<float> logGainGradients;        // [photos][3]
};
TESSERA_OPERATION(ExposureBackward);

}  // namespace tessera
