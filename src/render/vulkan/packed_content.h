// A content's arrays behind one another, as they go to a graphics card in one buffer.
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
  // → offset, a multiple of 16
  template <class T>
  size_t add(const std::vector<T>& values) {
    const size_t offset = bytes_.size();
    const auto from = std::as_bytes(std::span(values));
    bytes_.insert(bytes_.end(), from.begin(), from.end());
    bytes_.resize((bytes_.size() + kAlignment - 1) / kAlignment * kAlignment);
    return offset;
  }
  // Of what was added there; as many, of the same size.
  template <class T>
  void replace(size_t offset, const std::vector<T>& values) {
    std::memcpy(bytes_.data() + offset, values.data(), values.size() * sizeof(T));
  }
  const std::vector<std::byte>& bytes() const { return bytes_; }

 private:
  static constexpr size_t kAlignment = 16;
  std::vector<std::byte> bytes_;
};

// A network on the card.
struct GpuNetwork {
  uint64_t layers = 0, weights = 0;  // offsets, then addresses
  uint32_t layerCount = 0;
  uint32_t mostWidth = 0;  // inputs or outputs of a layer
};
GpuNetwork addNetwork(const std::vector<DenseLayer>& network, PackedContent& packed);

}  // namespace tessera
