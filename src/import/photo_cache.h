// Decoded photos under a byte budget: a capture larger than memory trains, and on all of its photos.
#pragma once

#include <cstdint>
#include <memory>

#include "base/image.h"
#include "scene/capture.h"

namespace tessera {

struct DecodedPhoto {
  ImageU8 image;  // 3 or 4 channels, the camera's size
  ImageU8 mask;   // 1 channel of the same size (0 = do not train on); empty when the photo has none
  size_t bytes() const { return image.pixels.size() + mask.pixels.size(); }
};

class PhotoCache {
 public:
  struct Statistics {
    int64_t hits = 0, misses = 0;
    size_t bytes = 0, peakBytes = 0;
  };

  // Budget 0: no limit. Keeps a reference to `capture`. Photos that someone still holds count towards the budget.
  PhotoCache(const Capture& capture, size_t budgetBytes);
  ~PhotoCache();
  PhotoCache(const PhotoCache&) = delete;
  PhotoCache& operator=(const PhotoCache&) = delete;

  // Decodes now unless cached or under way. Least recently used photos that nobody holds leave first. Throws Error
  // naming the file when it cannot be decoded.
  std::shared_ptr<const DecodedPhoto> get(int photo);

  // Starts decoding on the background thread; `get` then finds it. Ignored when the budget has no room.
  void prefetch(int photo);

  Statistics statistics() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// What a photo takes when decoded, from its camera's size alone.
size_t decodedBytes(const Capture& capture, int photo);

}  // namespace tessera
