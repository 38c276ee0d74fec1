// Marches rays through one part of a `hash` content and composites the samples (NGP-RT, section 4.3 and its
// supplement).
//
// Each straight segment of the path is divided, from its entry on, into steps of equal length in the domain, of which
// the last is shorter. One sample lies in the middle of each step, as in training (MarchBlocks). A sample is evaluated
// if its cell is occupied in the finest occupancy level. Otherwise the ray skips the empty cube of its octant
// (OctantDistanceField) or, without distances, the largest empty cell that contains the position. It always skips whole
// steps, so skipping does not change which samples are evaluated.
#pragma once

#include <span>
#include <vector>

#include "raymarch/cpu/march.h"
#include "representations/hash/cpu/hash_features.h"
#include "scene/domain_path.h"

namespace tessera {

struct HashRay {
  DomainPath path;
  float transmittanceBefore = 1;               // of all other contents in front of this one
  ContentComposite composite;                  // of what lies in front of this part; the samples are added to it
  std::vector<uint64_t>* evaluated = nullptr;  // optional: receives segment << 32 | step of each sample
};

// Composites diffuse colours and features as weighted sums, without any activation.
struct HashMarch {
  const HashFeatures& features;
  double step;  // HashContent::step
  MarchSettings settings;

  // Marches several rays in an interleaved way: each finds its next sample and prefetches its bytes, then all these
  // samples are interpolated. This hides the latency of memory. The result of a ray does not depend on the other rays.
  void run(std::span<HashRay* const> rays, MarchCounts& counts) const;
};

}  // namespace tessera
