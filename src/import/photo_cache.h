// A cache of decoded photos under a byte budget, so that a capture larger than memory can be trained on.
#pragma once

#include <cstdint>
#include <memory>
#include <thread>
#include <vector>

#include "base/image.h"
#include "scene/capture.h"

namespace tessera {

struct DecodedPhoto {
  ImageU8 image;  // 1, 3 or 4 channels, straight alpha, sRGB bytes; its camera's size
  ImageU8 mask;   // 1 channel, 0 = do not train on; empty when the photo has none
};

struct PhotoCacheCounts {
  int64_t hits = 0, misses = 0;  // of get(); a photo that prefetch() has loaded or is loading is a hit
  int64_t evictions = 0;
  int64_t bytes = 0, peakBytes = 0;  // of decoded pixels: cached, in use by callers, and being decoded
};

// Thread-safe. A photo's bytes count against the budget from before it is decoded until its last owner releases it. The
// cache evicts the least recently used photo that no caller owns; photos in use are not evicted, because that would
// free nothing. The bytes never exceed the budget, except for a photo that is larger than the budget, which is then the
// only one in memory.
class PhotoCache {
 public:
  PhotoCache(const Capture& capture, int64_t budgetBytes);
  ~PhotoCache();  // photos that callers own stay valid
  PhotoCache(const PhotoCache&) = delete;
  PhotoCache& operator=(const PhotoCache&) = delete;

  // Returns a photo, decoding it if it is not cached. Waits while photos in use take up the budget. Throws Error naming
  // the path if a file cannot be read, ends early or differs in size from its camera, and throws Error if no photo has
  // been released for a minute (the budget is too small for the photos in use at once).
  std::shared_ptr<const DecodedPhoto> get(int photo);

  // Asks the background thread to decode a photo soon, and returns at once. Only the last 64 requests are stored. A
  // failure is not reported here but by the next get() of the photo, which tries again.
  void prefetch(int photo);

  PhotoCacheCounts counts() const;

 private:
  struct State;
  std::shared_ptr<const DecodedPhoto> load(int photo, bool mayWait);
  void prefetchLoop();

  const std::vector<Photo> photos_;
  const std::vector<Camera> cameras_;
  std::shared_ptr<State> state_;  // shared with the photos that callers own
  std::thread prefetcher_;
};

}  // namespace tessera
