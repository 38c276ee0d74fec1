// The photos that rays are drawn from at a step: all of them when they fit the budget, else a window that moves over
// ever new shuffles of all photos, so that every photo gets its share. Which photos are in the window is a function of
// seed and step alone.
#pragma once

#include <vector>

#include "import/photo_cache.h"

namespace tessera {

// Of these photos when decoded, masks included, as the heads of the files say.
size_t decodedBytes(const Capture& capture, const std::vector<int>& photos);

class PhotoWindow {
 public:
  struct Settings {
    size_t budgetBytes = 0;  // of decoded photos; 0: no limit
    int stepsPerPhoto = 2;   // every so many steps the oldest photo of the window leaves and another comes
    uint64_t seed = 0;
  };

  // `photos` are the indices to train on. Keeps a reference to `capture`.
  PhotoWindow(const Capture& capture, std::vector<int> photos, const Settings& settings);

  // The photos of this step, decoded. The next one to come is decoded meanwhile. Valid until the next call.
  struct Entry {
    int photo;
    std::shared_ptr<const DecodedPhoto> decoded;
  };
  const std::vector<Entry>& at(int64_t step);

  int size() const { return size_; }
  bool holdsAll() const { return holdsAll_; }
  PhotoCacheCounts counts() const { return cache_.counts(); }

 private:
  int photoInSequence(int64_t position) const;  // shuffle after shuffle

  PhotoCache cache_;
  std::vector<int> photos_;
  Settings settings_;
  int size_ = 0;
  bool holdsAll_ = false;
  int64_t first_ = -1;          // sequence position of the window's oldest photo
  std::vector<Entry> entries_;  // entry i holds the sequence position ≡ i modulo size
  mutable int64_t shuffledEpoch_ = -1;
  mutable std::vector<int> shuffled_;
};

}  // namespace tessera
