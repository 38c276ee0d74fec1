// The photos that rays are drawn from at a step: all of them if they fit the memory budget, else a window that slides
// over repeated shuffles of all photos, so that every photo is used equally often. Which photos are in the window is a
// function of the seed and the step alone.
#pragma once

#include <vector>

#include "import/photo_cache.h"

namespace tessera {

// Returns the size of these photos in bytes when decoded, including masks, according to the headers of the files.
size_t decodedBytes(const Capture& capture, const std::vector<int>& photos);

class PhotoWindow {
 public:
  struct Settings {
    size_t budgetBytes = 0;  // of decoded photos; 0: no limit
    int stepsPerPhoto = 2;   // steps after which the oldest photo of the window is replaced by another
    uint64_t seed = 0;
  };

  // `photos`: indices of the photos to train on. Keeps a reference to `capture`.
  PhotoWindow(const Capture& capture, std::vector<int> photos, const Settings& settings);

  struct Entry {
    int photo;
    std::shared_ptr<const DecodedPhoto> decoded;
  };
  // Returns the decoded photos of this step, valid until the next call. The next photo is decoded in the background.
  const std::vector<Entry>& at(int64_t step);

  int size() const { return size_; }
  bool holdsAll() const { return holdsAll_; }
  PhotoCacheCounts counts() const { return cache_.counts(); }

 private:
  int photoInSequence(int64_t position) const;  // in the concatenation of all shuffles

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
