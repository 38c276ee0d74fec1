#include "train/photo_window.h"

#include <algorithm>

#include "base/check.h"
#include "base/image_io.h"
#include "base/random.h"

namespace tessera {
namespace {

// Returns the bytes that the cache counts for a photo: its channels, according to the file's header, and its mask.
size_t countDecodedBytes(const Capture& capture, const Photo& photo) {
  const Camera& camera = capture.cameras[photo.camera];
  const int channels = probeImageFile(photo.image).channels + (photo.mask.empty() ? 0 : 1);
  return static_cast<size_t>(camera.width) * camera.height * static_cast<size_t>(channels);
}

constexpr size_t kUnlimited = size_t{1} << 60;

}  // namespace

size_t decodedBytes(const Capture& capture, const std::vector<int>& photos) {
  size_t total = 0;
  for (const int photo : photos) total += countDecodedBytes(capture, capture.photos[photo]);
  return total;
}

PhotoWindow::PhotoWindow(const Capture& capture, std::vector<int> photos, const Settings& settings)
    : cache_(capture, static_cast<int64_t>(settings.budgetBytes ? settings.budgetBytes : kUnlimited)),
      photos_(std::move(photos)),
      settings_(settings) {
  CHECK(!photos_.empty());
  size_t total = 0, largest = 1;
  if (settings.budgetBytes > 0) {
    for (const int photo : photos_) {
      const size_t bytes = countDecodedBytes(capture, capture.photos[photo]);
      total += bytes;
      largest = std::max(largest, bytes);
    }
  }
  holdsAll_ = settings.budgetBytes == 0 || total <= settings.budgetBytes;
  // One place is reserved for the photo that is being decoded while the window is in use.
  size_ = holdsAll_ ? static_cast<int>(photos_.size())
                    : static_cast<int>(std::max<size_t>(2, settings.budgetBytes / largest) - 1);
  size_ = std::min<int>(size_, static_cast<int>(photos_.size()));
  entries_.resize(size_);
}

int PhotoWindow::photoInSequence(int64_t position) const {
  const int64_t count = static_cast<int64_t>(photos_.size()), epoch = position / count;
  if (epoch != shuffledEpoch_) {
    shuffled_ = photos_;
    const RandomStream random(settings_.seed, 0x5407 + (static_cast<uint64_t>(epoch) << 16));
    for (int64_t i = count - 1; i > 0; --i) {
      std::swap(shuffled_[i], shuffled_[random.below(i, static_cast<uint32_t>(i + 1))]);
    }
    shuffledEpoch_ = epoch;
  }
  return shuffled_[position % count];
}

const std::vector<PhotoWindow::Entry>& PhotoWindow::at(int64_t step) {
  if (holdsAll_) {
    if (first_ < 0) {
      for (int i = 0; i < size_; ++i) entries_[i] = {photos_[i], cache_.get(photos_[i])};
      first_ = 0;
    }
    return entries_;
  }
  const int64_t first = step / settings_.stepsPerPhoto;
  if (first == first_) return entries_;
  const bool next = first_ >= 0 && first == first_ + 1;
  for (int64_t position = next ? first + size_ - 1 : first; position < first + size_; ++position) {
    Entry& entry = entries_[position % size_];
    entry.decoded.reset();  // frees its share of the budget before the new photo is decoded
    entry.photo = photoInSequence(position);
    entry.decoded = cache_.get(entry.photo);
  }
  first_ = first;
  cache_.prefetch(photoInSequence(first + size_));
  return entries_;
}

}  // namespace tessera
