// Contents of scenes on a graphics card: their bytes as they lie in memory, reached by address.
#pragma once

#include <array>
#include <memory>

#include "gpu/stream.h"
#include "render/vulkan/packed_content.h"
#include "tiles/hash_content.h"
#include "tiles/volume_content.h"

namespace tessera {

// One buffer, which goes when the card has done what it was asked to do with it.
class GpuContentMemory {
 public:
  GpuContentMemory() = default;
  GpuContentMemory(std::shared_ptr<GpuStream> stream, size_t bytes)
      : stream_(std::move(stream)), buffer_(stream_->makeBuffer(bytes)) {}
  ~GpuContentMemory() {
    if (buffer_) stream_->retire(std::move(buffer_));
  }
  GpuContentMemory(GpuContentMemory&& other) noexcept { *this = std::move(other); }
  GpuContentMemory& operator=(GpuContentMemory&& other) noexcept {
    std::swap(stream_, other.stream_);
    std::swap(buffer_, other.buffer_);
    return *this;
  }

  void upload(const PackedContent& packed) { stream_->upload(buffer_, 0, packed.bytes()); }
  uint64_t address() const { return buffer_.address(); }
  size_t bytes() const { return buffer_.bytes(); }

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer buffer_;
};

// Each takes no more of the card than the content that it is made of takes in memory.
struct GpuVolumeContent {
  GpuVolumeContent() = default;
  GpuVolumeContent(const std::shared_ptr<GpuStream>& stream, const VolumeContent& content);

  GpuContentMemory memory;
  float featureRange = 0, densityRange = 0, stepsPerTexel = 1;
  uint32_t partCount = 0;
  uint64_t parts = 0;  // address
  GpuNetwork network;
};

struct GpuHashContent {
  GpuHashContent() = default;
  GpuHashContent(const std::shared_ptr<GpuStream>& stream, const HashContent& content);

  GpuContentMemory memory;
  LevelWeights weights = LevelWeights::separate;
  bool varies = false;  // from place to place; else `levelWeights` are those of density and of all else
  std::array<float, 2 * HashPart::kMostTables> levelWeights = {};
  float step = 0;
  bool isWhole = false;
  uint32_t partCount = 0, tables = 0, columns = 0;
  uint64_t parts = 0, vectors = 0;  // addresses
  GpuNetwork network;
  std::vector<DenseLayer> layers;  // of the network: contents with the same numbers have the same one
};

inline uint64_t bytesInMemory(const GpuVolumeContent& content) {
  return content.memory.bytes();
}
inline uint64_t bytesInMemory(const GpuHashContent& content) {
  return content.memory.bytes();
}

}  // namespace tessera
