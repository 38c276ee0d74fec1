// Samples of one part of a `hash` content along a ray, composited (NGP-RT, section 4.3 and its supplement).
//
// Each straight piece of the path is cut, from its entry on, into steps of one length in the domain, the last one
// shorter; in the middle of each lies a sample, as in training (MarchBlocks). A sample is evaluated where the finest
// occupancy says that something is. Where it says no, the ray leaves the empty cube of its octant (OctantDistances),
// or, without these, the largest empty cell that holds the place; always by whole steps, so which samples are evaluated
// does not depend on it.
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
  ContentComposite composite;                  // what lies in front of this part; is gone on with
  std::vector<uint64_t>* evaluated = nullptr;  // optional: piece << 32 | step of each sample is added
};

// Of a composite's values, diffuse colour and features are sums before any activation.
struct HashMarch {
  const HashFeatures& features;
  double step;  // HashContent::step
  MarchSettings settings;

  // Rays take turns: each finds its next sample and asks for its bytes; then all samples are mixed. So none waits for
  // memory, and the processor always has several things to do. Rays do not depend on their company.
  void run(std::span<HashRay* const> rays, MarchCounts& counts) const;
};

}  // namespace tessera
