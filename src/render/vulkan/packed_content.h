// The arrays of a content packed into one buffer for upload to the GPU.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "shaders/render/arguments_view.h"
#include "tiles/dense_layer.h"

namespace tessera {

class PackedContent {
 public:
  // Appends an array and returns its offset, a multiple of 16.
  template <class T>
  size_t add(const std::vector<T>& values) {
    const size_t offset = bytes_.size();
    const auto from = std::as_bytes(std::span(values));
    bytes_.insert(bytes_.end(), from.begin(), from.end());
    bytes_.resize((bytes_.size() + kAlignment - 1) / kAlignment * kAlignment);
    return offset;
  }
  // Overwrites an array that was added at `offset`; the new one must have the same number and size of elements.
  template <class T>
  void replace(size_t offset, const std::vector<T>& values) {
    std::memcpy(bytes_.data() + offset, values.data(), values.size() * sizeof(T));
  }
  const std::vector<std::byte>& bytes() const { return bytes_; }

 private:
  static constexpr size_t kAlignment = 16;
  std::vector<std::byte> bytes_;
};

// A network in GPU memory.
struct GpuNetwork {
  uint64_t layers = 0, weights = 0;  // offsets in the packed content, later device addresses
  uint32_t layerCount = 0;
  uint32_t maxWidth = 0;  // largest number of inputs or outputs of a layer
};
GpuNetwork addNetwork(const std::vector<DenseLayer>& network, PackedContent& packed);

}  // namespace tessera
