#include "import/photo_cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <list>
#include <mutex>
#include <unordered_map>
#include <unordered_set>

#include "base/check.h"
#include "base/error.h"
#include "base/image_io.h"

namespace tessera {
namespace {

constexpr auto kPatience = std::chrono::seconds(60);
constexpr size_t kMaxRequests = 64;

struct Encoded {
  Bytes image, mask;
  int64_t decodedBytes = 0;
};

ImageInfo checkedInfo(const Bytes& bytes, const fs::path& path, const Camera& camera) {
  const auto info = probeImage(bytes);
  if (!info) throw Error(path.string(), "", "is not a JPEG or PNG", "import the photos again");
  if (info->width != camera.width || info->height != camera.height) {
    throw Error(path.string(), "",
                fmt::format("is {}x{}, its camera {}x{}", info->width, info->height, camera.width, camera.height),
                "import the photos again");
  }
  return *info;
}

// Reads the files and determines the decoded size, so that memory can be reserved before anything is decoded.
Encoded readEncoded(const Photo& photo, const Camera& camera) {
  Encoded encoded;
  const int64_t pixels = int64_t{camera.width} * camera.height;
  encoded.image = readFile(photo.image);
  encoded.decodedBytes = pixels * checkedInfo(encoded.image, photo.image, camera).channels;
  if (!photo.mask.empty()) {
    encoded.mask = readFile(photo.mask);
    checkedInfo(encoded.mask, photo.mask, camera);
    encoded.decodedBytes += pixels;
  }
  return encoded;
}

ImageU8 decodeWhole(const Bytes& bytes, const fs::path& path) {
  auto decoded = decodeImage(bytes);
  if (!decoded) throw Error(path.string(), "", "cannot be decoded", "import the photos again");
  if (decoded->truncated) throw Error(path.string(), "", "ends early", "import the photos again");
  return std::move(decoded->image);
}

ImageU8 firstChannel(ImageU8 image) {
  if (image.channels == 1) return image;
  ImageU8 mask(image.width, image.height, 1);
  for (size_t i = 0; i < mask.pixels.size(); ++i)
    mask.pixels[i] = image.pixels[i * static_cast<size_t>(image.channels)];
  return mask;
}

}  // namespace

struct PhotoCache::State : std::enable_shared_from_this<State> {
  struct Entry {
    std::shared_ptr<const DecodedPhoto> photo;
    std::list<int>::iterator use;
  };

  explicit State(int64_t budgetBytes) : budget(budgetBytes) {}

  const int64_t budget;
  mutable std::mutex mutex;
  std::condition_variable changed;  // bytes were released, a photo was loaded, a request was added, or `stopping`
  std::unordered_map<int, Entry> entries;
  std::list<int> uses;  // photos, the most recently used first
  std::unordered_set<int> loading;
  std::deque<int> requests;
  PhotoCacheCounts counts;
  bool stopping = false;

  void release(int64_t bytes) {
    {
      const std::lock_guard lock(mutex);
      counts.bytes -= bytes;
    }
    changed.notify_all();
  }

  // Reserves bytes, evicting photos that no caller owns. Returns false if it would have to wait and `mayWait` is false.
  bool reserve(std::unique_lock<std::mutex>& lock, int64_t bytes, bool mayWait) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (counts.bytes > 0 && counts.bytes + bytes > budget) {
      const auto idle = std::find_if(uses.rbegin(), uses.rend(),
                                     [this](int photo) { return entries.at(photo).photo.use_count() == 1; });
      if (idle != uses.rend()) {
        const auto entry = entries.find(*idle);
        std::shared_ptr<const DecodedPhoto> leaving = std::move(entry->second.photo);
        uses.erase(entry->second.use);
        entries.erase(entry);
        ++counts.evictions;
        lock.unlock();  // the deleter calls release()
        leaving.reset();
        lock.lock();
      } else if (!mayWait) {
        return false;
      } else if (changed.wait_until(lock, deadline) == std::cv_status::timeout) {
        throw Error("photo cache", "", fmt::format("all of its {} MB have been held for a minute", budget / 1000000),
                    "raise --set photo_budget_mib");
      }
    }
    counts.bytes += bytes;
    counts.peakBytes = std::max(counts.peakBytes, counts.bytes);
    return true;
  }

  std::shared_ptr<const DecodedPhoto> use(int photo) {
    const auto entry = entries.find(photo);
    if (entry == entries.end()) return nullptr;
    uses.splice(uses.begin(), uses, entry->second.use);
    return handOut(entry->second.photo);
  }

  // Returns a pointer whose deleter notifies waiting threads. The cache's own pointer is never returned, because a
  // thread that waits for memory must be notified when the last caller releases a photo, even though the photo stays
  // cached.
  std::shared_ptr<const DecodedPhoto> handOut(std::shared_ptr<const DecodedPhoto> photo) {
    const DecodedPhoto* seen = photo.get();
    return {seen, [state = shared_from_this(), photo = std::move(photo)](const DecodedPhoto*) mutable {
              photo.reset();
              { const std::lock_guard lock(state->mutex); }  // not between a waiter's check and its wait
              state->changed.notify_all();
            }};
  }
};

PhotoCache::PhotoCache(const Capture& capture, int64_t budgetBytes)
    : photos_(capture.photos),
      cameras_(capture.cameras),
      state_(std::make_shared<State>(budgetBytes)),
      prefetcher_([this] { prefetchLoop(); }) {}

PhotoCache::~PhotoCache() {
  std::unordered_map<int, State::Entry> leaving;
  {
    const std::lock_guard lock(state_->mutex);
    state_->stopping = true;
  }
  state_->changed.notify_all();
  prefetcher_.join();
  const std::lock_guard lock(state_->mutex);
  leaving.swap(state_->entries);  // destroyed after the unlock, as it is declared before the lock
}

std::shared_ptr<const DecodedPhoto> PhotoCache::get(int photo) {
  CHECK(photo >= 0);
  CHECK(photo < static_cast<int>(photos_.size()));
  {
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [&] { return !state_->loading.contains(photo); });
    if (auto cached = state_->use(photo)) {
      ++state_->counts.hits;
      return cached;
    }
    ++state_->counts.misses;
    state_->loading.insert(photo);
  }
  return load(photo, true);
}

// Loads a photo that the caller has put into State::loading. Returns nothing if memory was short and `mayWait` is
// false.
std::shared_ptr<const DecodedPhoto> PhotoCache::load(int photo, bool mayWait) {
  const std::shared_ptr<State> state = state_;
  const Photo& source = photos_[static_cast<size_t>(photo)];
  int64_t reserved = 0;
  std::shared_ptr<const DecodedPhoto> loaded;
  const auto finish = [&] {
    {
      const std::lock_guard lock(state->mutex);
      state->loading.erase(photo);
      if (loaded) {
        state->uses.push_front(photo);
        state->entries[photo] = {std::move(loaded), state->uses.begin()};
      }
    }
    state->changed.notify_all();
  };
  try {
    Encoded encoded = readEncoded(source, cameras_[static_cast<size_t>(source.camera)]);
    {
      std::unique_lock lock(state->mutex);
      if (state->reserve(lock, encoded.decodedBytes, mayWait)) reserved = encoded.decodedBytes;
    }
    if (reserved > 0) {
      auto decoded = std::make_unique<DecodedPhoto>();
      decoded->image = decodeWhole(encoded.image, source.image);
      if (!encoded.mask.empty()) decoded->mask = firstChannel(decodeWhole(encoded.mask, source.mask));
      loaded = std::shared_ptr<const DecodedPhoto>(decoded.release(), [state, reserved](const DecodedPhoto* old) {
        delete old;
        state->release(reserved);
      });
    }
  } catch (...) {
    if (reserved > 0) state->release(reserved);
    finish();
    throw;
  }
  std::shared_ptr<const DecodedPhoto> handed = loaded ? state->handOut(loaded) : nullptr;
  finish();
  return handed;
}

void PhotoCache::prefetch(int photo) {
  CHECK(photo >= 0);
  CHECK(photo < static_cast<int>(photos_.size()));
  {
    const std::lock_guard lock(state_->mutex);
    if (state_->entries.contains(photo) || state_->loading.contains(photo)) return;
    if (std::find(state_->requests.begin(), state_->requests.end(), photo) != state_->requests.end()) return;
    state_->requests.push_back(photo);
    if (state_->requests.size() > kMaxRequests) state_->requests.pop_front();
  }
  state_->changed.notify_all();
}

void PhotoCache::prefetchLoop() {
  while (true) {
    int photo = -1;
    {
      std::unique_lock lock(state_->mutex);
      state_->changed.wait(lock, [this] { return state_->stopping || !state_->requests.empty(); });
      if (state_->stopping) return;
      photo = state_->requests.front();
      state_->requests.pop_front();
      if (state_->entries.contains(photo) || state_->loading.contains(photo)) continue;
      state_->loading.insert(photo);
    }
    try {
      load(photo, false);
    } catch (const std::exception&) {
      // get() tries again and reports the failure.
    }
  }
}

PhotoCacheCounts PhotoCache::counts() const {
  const std::lock_guard lock(state_->mutex);
  return state_->counts;
}

}  // namespace tessera
