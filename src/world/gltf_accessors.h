// The buffers of a glTF 2.0 file, and the numbers in them. Neither offsets nor counts of the file are trusted.
// Source: Khronos glTF 2.0 specification, section 3.6.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "tiles/json_fields.h"
#include "world/model_assembler.h"

namespace tessera {

class GltfAccessors {
 public:
  // Reads the file's buffers. `binary`: the binary chunk of a GLB. `gltf`, `binary` and `files` must outlive the
  // object. All functions throw Error that names the place in the file.
  GltfAccessors(const nlohmann::json& gltf, std::span<const std::byte> binary, const ModelAssembler& files,
                const ModelLimits& limits);

  // Returns the number of elements of accessor `index`.
  uint64_t count(uint64_t index) const;
  // Returns some of its elements, which must be below its count, in this order: `components` floats of each. Integers
  // that are normalised become 0 to 1, or -1 to 1. Components that it lacks are `otherwise`.
  std::vector<float> floats(uint64_t index, size_t components, std::span<const uint32_t> elements,
                            float otherwise = 0) const;
  // Returns all of its elements, which must be unsigned integers.
  std::vector<uint32_t> indices(uint64_t index) const;
  std::span<const std::byte> view(uint64_t index) const;
  // Counts work, in numbers that are read, and throws where a file asks for too much of it.
  void spend(uint64_t work) const;

 private:
  struct Numbers;
  std::vector<std::byte> loadBuffer(const nlohmann::json& buffer, size_t number) const;
  Numbers locate(const nlohmann::json& accessor, const std::string& place) const;
  std::vector<uint32_t> sparseIndices(const nlohmann::json& accessor, const std::string& place) const;
  std::vector<uint32_t> integers(const nlohmann::json& accessor, const std::string& place) const;
  [[noreturn]] void refuse(const std::string& place, const std::string& reason) const;

  const nlohmann::json& gltf_;
  const ModelAssembler& files_;
  std::vector<std::vector<std::byte>> loaded_;
  std::vector<std::span<const std::byte>> buffers_;
  mutable uint64_t spent_ = 0;  // numbers that were read so far: a small file can ask for the same ones again and again
};

}  // namespace tessera
