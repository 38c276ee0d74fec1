// The safetensors container: an 8-byte little-endian header length, a JSON header, raw tensors.
// Source: the format description of huggingface/safetensors.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"

namespace tessera {

enum class TensorType { f64, f32, f16, i64, i32, u32, u16, u8 };
size_t bytesPerElement(TensorType type);

struct TensorView {
  TensorType type = TensorType::f32;
  std::vector<int64_t> shape;
  std::span<const std::byte> bytes;  // borrowed from the file; length = product(shape) × bytesPerElement

  int64_t elements() const;
  template <class T>
  std::span<const T> as() const {  // the caller has checked `type`
    return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
  }
};

struct Safetensors {  // moves, never copies: the views point into the storage
  Safetensors() = default;
  Safetensors(Safetensors&&) = default;
  Safetensors& operator=(Safetensors&&) = default;

  Bytes storage;
  std::map<std::string, TensorView> tensors;
  std::map<std::string, std::string> metadata;

  // The tensor of that name and type, or Error naming `path` and what is there instead.
  const TensorView& require(const fs::path& path, const std::string& name, TensorType type) const;
};

// Nothing when the bytes are not a well-formed file: overlapping or out-of-range offsets, shapes that disagree with
// lengths, misaligned tensors (copied to an aligned place, not refused), headers above 100 MiB.
std::optional<Safetensors> decodeSafetensors(Bytes bytes);
Safetensors readSafetensors(const fs::path& path);

// Data in order of element size, then name, so that every tensor is aligned without holes (the header pads to 8 bytes):
// the same content gives the same bytes.
Bytes encodeSafetensors(const std::map<std::string, TensorView>& tensors,
                        const std::map<std::string, std::string>& metadata = {});

}  // namespace tessera
