// Samples of one part of a content along a ray, composited (City-on-Web, section 4.2; MERF, section 4.4).
//
// Each straight piece of the path is cut, from its entry on, into steps of one texel of the planes (or of the share
// that the content's stepsPerTexel says), the last one shorter; in the middle of each lies a sample. A sample is
// evaluated where the distance grid says that something may be and the macroblock is stored. Skipping passes over steps
// in the empty cube around a cell at once, and lands on the same steps: which samples are evaluated does not depend on
// it.
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
  std::vector<MarchedSample>* trace = nullptr;  // optional: what is evaluated is added here

  // Goes on with `composite`, which holds the content's parts in front of this one.
  void run(ContentComposite& composite, MarchCounts& counts) const;
};

}  // namespace tessera
