// The rays of one training step on the device: the pixels and photos that they belong to, and their target colours.
#pragma once

#include <optional>

#include "compute/device.h"
#include "train/photo_window.h"
#include "train/ray_batch.h"
#include "train/scene_frame.h"

namespace tessera {

class PhotoRays {
 public:
  struct Settings {
    uint64_t seed = 0;
    uint32_t maxRays = 1 << 14;
    double photoBudgetMiB = 0;  // of decoded photos; 0: no limit
    int stepsPerPhoto = 2;
    bool randomBackground = true;
    double sparseDepthRayFraction = 0;  // share of the rays that go through sparse points
    bool nearFromSparseDepth = false;   // start rays at the nearest sparse depth of their photo, see nears()
    // Rays through sparse points start and end this far before and behind the point, as a share of its distance; 0:
    // they are bounded like other rays.
    double sparseDepthMargin = 0;
    // Random numbers per ray: the first is that of RayBatch, the others differ from it by multiples of the golden
    // ratio.
    uint32_t jitters = 1;
    std::vector<int> photos = {};  // to draw from; empty: all training photos
  };
  // Draws rays from the capture's training photos; throws Error if there are none. Keeps references to `device` and
  // `capture`.
  PhotoRays(Device& device, const Capture& capture, const SceneFrame& frame, const Settings& settings);

  // Draws the rays of a step: a function of the seed, the step, the number of rays, and the tiles that they are drawn
  // from. Without a call of drawFrom they are drawn from whole photos.
  // With `square` above 1 they are squares of so many neighbouring pixels along an edge (RayBatchOptions).
  void draw(int64_t step, uint32_t rays, uint32_t square = 1);
  void drawFrom(std::vector<TileShares> tiles) { tiles_ = std::move(tiles); }  // [photo]

  const RayBatch& batch() const { return batch_; }
  uint32_t count() const { return count_; }
  // The following return the data of rays [first, first + rays) of the step.
  Slice<const uint32_t> photoOfRay(uint32_t first, uint32_t rays) const { return photoOfRay_.part(first, rays); }
  Slice<const float> targets(uint32_t first, uint32_t rays) const { return three(targets_, first, rays); }
  Slice<const float> backgrounds(uint32_t first, uint32_t rays) const { return three(backgrounds_, first, rays); }
  Slice<const float> weights(uint32_t first, uint32_t rays) const { return weights_.part(first, rays); }
  Slice<const float> opaqueWeights(uint32_t first, uint32_t rays) const { return opaqueWeights_.part(first, rays); }
  Slice<const float> distances(uint32_t first, uint32_t rays) const { return distances_.part(first, rays); }
  // The distances at which rays start and end, scene units. With `sparseDepthMargin`, rays through a sparse point start
  // and end around it. With `nearFromSparseDepth`, other rays start at kNearShare of the nearest depth observed in
  // their photo (nearestSparseDepth). Otherwise they are 0 and infinity.
  Slice<const float> nears(uint32_t first, uint32_t rays) const { return nears_.part(first, rays); }
  Slice<const float> fars(uint32_t first, uint32_t rays) const { return fars_.part(first, rays); }
  Slice<const float> origins(uint32_t first, uint32_t rays) const { return three(origins_, first, rays); }
  Slice<const float> directions(uint32_t first, uint32_t rays) const { return three(directions_, first, rays); }
  Slice<const float> jitter(uint32_t first, uint32_t rays) const { return jitter_.part(first, rays); }
  // [jitters][count]
  Slice<const float> jitters() const { return jitter_.part(0, size_t{count_} * settings_.jitters); }

 private:
  void limitRays();
  static Slice<const float> three(const Array<float>& array, uint32_t first, uint32_t rays) {
    return array.part(size_t{3} * first, size_t{3} * rays);
  }

  Device& device_;
  Settings settings_;
  ThreadPool pool_;
  PhotoWindow photos_;
  std::vector<std::vector<SparseDepth>> known_;  // [photo]
  std::vector<float> nearOfPhoto_;               // with nearFromSparseDepth
  std::optional<std::vector<TileShares>> tiles_;
  RayBatch batch_;
  uint32_t count_ = 0;
  Array<RayCamera> cameras_;
  Array<uint32_t> photoOfRay_;
  Array<float> pixels_, targets_, backgrounds_, weights_, opaqueWeights_, jitter_, distances_, nears_, fars_, origins_,
      directions_;
};

}  // namespace tessera
