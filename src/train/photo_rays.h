// The rays of one training step, on the device: through which pixels of which photos, and what they should see.
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
    uint32_t mostRays = 1 << 14;
    double photoBudgetMiB = 0;  // of decoded photos; 0: no limit
    int stepsPerPhoto = 2;
    bool randomBackground = true;
    double knownShare = 0;   // of the rays, through sparse points
    bool freeSpace = false;  // also how far rays go through nothing
    // Rays through sparse points begin and end as much before and behind them, as a share of their distance; 0: they
    // are like others.
    double knownBracket = 0;
    // Numbers a ray; the first is RayBatch's, the others differ from it by multiples of the golden ratio.
    uint32_t jitters = 1;
  };
  // Trains on the capture's training photos; Error when there are none. Keeps references to `device` and `capture`.
  PhotoRays(Device& device, const Capture& capture, const SceneFrame& frame, const Settings& settings);

  // A function of seed, step, number of rays, and the tiles that they are drawn from (all of each photo without).
  void draw(int64_t step, uint32_t rays);
  void drawFrom(std::vector<TileShares> tiles) { tiles_ = std::move(tiles); }  // [photo]

  const RayBatch& batch() const { return batch_; }
  uint32_t count() const { return count_; }
  // Rays [first, first + rays) of the step.
  Slice<const uint32_t> photoOfRay(uint32_t first, uint32_t rays) const { return photoOfRay_.part(first, rays); }
  Slice<const float> targets(uint32_t first, uint32_t rays) const { return three(targets_, first, rays); }
  Slice<const float> backgrounds(uint32_t first, uint32_t rays) const { return three(backgrounds_, first, rays); }
  Slice<const float> weights(uint32_t first, uint32_t rays) const { return weights_.part(first, rays); }
  Slice<const float> distances(uint32_t first, uint32_t rays) const { return distances_.part(first, rays); }
  // Where rays are to begin and end, scene units: before that no point was seen in the ray's photo (nearestContent),
  // with `freeSpace`; or about the ray's sparse point, with `knownBracket`. Else 0 and infinity.
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
  std::vector<std::vector<KnownDistance>> known_;  // [photo]
  std::vector<float> nearOfPhoto_;                 // with freeSpace
  std::optional<std::vector<TileShares>> tiles_;
  RayBatch batch_;
  uint32_t count_ = 0;
  Array<RayCamera> cameras_;
  Array<uint32_t> photoOfRay_;
  Array<float> pixels_, targets_, backgrounds_, weights_, jitter_, distances_, nears_, fars_, origins_, directions_;
};

}  // namespace tessera
