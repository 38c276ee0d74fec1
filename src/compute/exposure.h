// Exposure of photos: a learned gain per photo and colour channel.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Per-photo exposure: exposed = colour · 2^(logGain[photo of ray]) + (1 - opacity) · background per channel, in the
// trained colour space. `colours` contain the scene alone, because the gain does not apply to the background.
struct ExposureForward {
  Count rays;
  Slice<const float> colours;        // [rays][3]
  Slice<const float> opacity;        // [rays]; read only with a background
  Slice<const float> background;     // optional, [rays][3]; black if absent
  Slice<const uint32_t> photoOfRay;  // [rays]
  Slice<const float> logGains;       // [photos][3]
  Slice<float> exposed;              // [rays][3]
};
TESSERA_OPERATION(ExposureForward);

// Overwrites colourGradients and opacityGradients, and adds to logGainGradients.
struct ExposureBackward {
  Count rays;
  Slice<const float> colours;
  Slice<const float> background;
  Slice<const uint32_t> photoOfRay;
  Slice<const float> logGains;
  Slice<const float> exposedGradients;  // [rays][3]
  Slice<float> colourGradients;         // [rays][3]; may be the same memory as exposedGradients
  Slice<float> opacityGradients;        // [rays]; written only with a background
  Slice<float> logGainGradients;        // [photos][3]
};
TESSERA_OPERATION(ExposureBackward);

}  // namespace tessera
