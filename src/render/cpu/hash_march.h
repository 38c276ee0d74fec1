// Samples of one part of a `hash` content along a ray, composited (NGP-RT, section 4.3 and its supplement).
//
// Each straight piece of the path is cut, from its entry on, into steps of one length in the domain, the last one
// shorter; in the middle of each lies a sample, as in training (MarchBlocks). A sample is evaluated where the finest
// occupancy says that something is. Where it says no, the ray leaves the empty cube of its octant (octantDistances), or
// else the largest empty cell that holds the place; always by whole steps, so which samples are evaluated does not
// depend on it.
#pragma once

#include <vector>

#include "render/cpu/hash_features.h"
#include "render/cpu/march.h"
#include "scene/domain_path.h"

namespace tessera {

struct HashMarch {
  const HashFeatures& features;
  double step;  // HashContent::step
  const DomainPath& path;
  MarchSettings settings;
  float transmittanceBefore = 1;               // of all other contents in front of this one
  std::vector<uint64_t>* evaluated = nullptr;  // optional: piece << 32 | step of each sample is added

  // Goes on with `composite`, which holds what lies in front of this part. Of its values, diffuse colour and features
  // are sums before any activation.
  void run(ContentComposite& composite, MarchCounts& counts) const;
};

}  // namespace tessera
