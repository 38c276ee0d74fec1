// Rays that cross a block and show only what lies behind it: nothing in the block may be visible along them, whatever
// the photos show there.
#pragma once

#include "compute/device.h"
#include "representations/mesh/train/mesh_level.h"
#include "scene/capture.h"
#include "train/photo_tiles.h"

namespace tessera {

class ThroughRays {
 public:
  // Draws from pixels of `tiles`, at least one; `frame`: of the part. Keeps a reference to `device`.
  ThroughRays(Device& device, const Capture& capture, const SceneFrame& frame, TileShares tiles, uint64_t seed,
              uint32_t maxRays);

  // Draws the rays of a step: a function of the seed, the step and the number of rays.
  void draw(int64_t step, uint32_t rays);
  MeshRays rays() const;  // of the last draw

 private:
  Device& device_;
  TileShares tiles_;
  uint64_t seed_;
  uint32_t count_ = 0;
  Array<RayCamera> cameras_;
  Array<uint32_t> photoOfRay_;
  Array<float> pixels_, origins_, directions_;
};

}  // namespace tessera
