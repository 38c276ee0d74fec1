// Contents of `volume` on a graphics card: their bytes as they lie in memory, reached by address.
#pragma once

#include <memory>

#include "gpu/stream.h"
#include "tiles/volume_content.h"

namespace tessera {

class GpuVolumeContent {
 public:
  GpuVolumeContent() = default;
  GpuVolumeContent(std::shared_ptr<GpuStream> stream, const VolumeContent& content);
  ~GpuVolumeContent() {
    if (memory_) stream_->retire(std::move(memory_));
  }
  GpuVolumeContent(GpuVolumeContent&&) noexcept = default;
  GpuVolumeContent& operator=(GpuVolumeContent&& other) noexcept {
    std::swap(stream_, other.stream_);
    std::swap(memory_, other.memory_);
    about_ = other.about_;
    return *this;
  }

  struct About {
    float featureRange = 0, densityRange = 0, stepsPerTexel = 1;
    uint32_t parts = 0, layers = 0, mostWidth = 0;  // inputs or outputs of a layer
    uint64_t partsAddress = 0, layersAddress = 0, weightsAddress = 0;
  };
  const About& about() const { return about_; }
  size_t bytes() const { return memory_.bytes(); }

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer memory_;
  About about_;
};

// What it takes on the card: no more than the content takes in memory.
inline uint64_t bytesInMemory(const GpuVolumeContent& content) {
  return content.bytes();
}

}  // namespace tessera
