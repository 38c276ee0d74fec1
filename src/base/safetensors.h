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
  std::span<const std::byte> bytes;  // not owned (see Safetensors::storage); product(shape) × bytesPerElement

  int64_t elements() const;
  template <class T>
  std::span<const T> as() const {  // the caller must have checked `type`
    return {reinterpret_cast<const T*>(bytes.data()), bytes.size() / sizeof(T)};
  }
};

struct Safetensors {  // movable but not copyable: the views point into `storage`
  Safetensors() = default;
  Safetensors(Safetensors&&) = default;
  Safetensors& operator=(Safetensors&&) = default;

  Bytes storage;
  std::map<std::string, TensorView> tensors;
  std::map<std::string, std::string> metadata;

  // Returns the tensor `name`. Throws Error naming `path` if there is none, or if its type is not `type`.
  const TensorView& require(const fs::path& path, const std::string& name, TensorType type) const;
};

// Returns nothing if the bytes are not a well-formed file: overlapping or out-of-range offsets, shapes that disagree
// with lengths, headers above 100 MiB. Misaligned tensors are accepted and copied to an aligned address.
std::optional<Safetensors> decodeSafetensors(Bytes bytes);
// Decodes a file. Throws Error naming the path if it cannot be read or is not well-formed.
Safetensors readSafetensors(const fs::path& path);

// Encodes the tensors in order of element size, then name, so that every tensor is aligned without gaps (the header is
// padded to 8 bytes). The same content always gives the same bytes.
Bytes encodeSafetensors(const std::map<std::string, TensorView>& tensors,
                        const std::map<std::string, std::string>& metadata = {});

}  // namespace tessera
