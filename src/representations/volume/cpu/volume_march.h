// Samples one part of a content along a ray and composites the samples (City-on-Web, section 4.2; MERF, section 4.4).
//
// Each straight segment of the path is divided, from its entry on, into steps of one texel of the planes (divided by
// the content's stepsPerTexel); the last step is shorter. A sample lies in the middle of each step. It is evaluated if
// its cell of the distance grid may contain something and its macroblock is stored. Skipping jumps over all steps
// within the empty cube around a cell and resumes at the same steps, so that it does not change which samples are
// evaluated.
#pragma once

#include <vector>

#include "raymarch/cpu/march.h"
#include "representations/volume/cpu/volume_path.h"

namespace tessera {

struct MarchedSample {
  int segment = 0;
  uint32_t step = 0;
  float opacity = 0, distance = 0;
};

struct VolumeMarch {
  const VolumeContent& content;
  const VolumePart& part;  // of `content`
  const VolumePath& path;
  MarchSettings settings;
  float transmittanceBefore = 1;                // of all other contents in front of this one
  std::vector<MarchedSample>* trace = nullptr;  // optional: evaluated samples are appended to it

  // Marches through the part. `composite` holds the result of the content's parts in front of this one and is updated.
  void run(ContentComposite& composite, MarchCounts& counts) const;
};

}  // namespace tessera
