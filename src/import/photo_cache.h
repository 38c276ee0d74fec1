// Decoded photos under a byte budget, so that a capture larger than memory can be trained on.
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
  int64_t hits = 0, misses = 0;  // of get(); a photo that prefetch() has brought or is bringing in is a hit
  int64_t evictions = 0;
  int64_t bytes = 0, peakBytes = 0;  // decoded pixels: cached, handed out, and being decoded
};

// Thread-safe. A photo's bytes are counted from before it is decoded until its last holder lets go of it. The least
// recently used photo that nobody holds leaves first; held ones stay, for their leaving would free nothing. Bytes never
// exceed the budget, but for a photo that is larger than all of it, which is in memory alone.
class PhotoCache {
 public:
  PhotoCache(const Capture& capture, int64_t budgetBytes);
  ~PhotoCache();  // held photos live on
  PhotoCache(const PhotoCache&) = delete;
  PhotoCache& operator=(const PhotoCache&) = delete;

  // Waits while the whole budget is held by others. Throws Error when a file cannot be read, ends early or is not of
  // its camera's size (naming the path), and when nothing has been let go for a minute (the budget is too small for
  // what is held at once).
  std::shared_ptr<const DecodedPhoto> get(int photo);

  // Asks the background thread to decode a photo soon. Returns at once; only the last 64 requests are kept. What fails
  // here fails again, and is told, at get().
  void prefetch(int photo);

  PhotoCacheCounts counts() const;

 private:
  struct State;
  std::shared_ptr<const DecodedPhoto> load(int photo, bool mayWait);
  void prefetchLoop();

  const std::vector<Photo> photos_;
  const std::vector<Camera> cameras_;
  std::shared_ptr<State> state_;  // shared with the photos that are held
  std::thread prefetcher_;
};

}  // namespace tessera
