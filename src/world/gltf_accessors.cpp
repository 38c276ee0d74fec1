#include "world/gltf_accessors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "world/world_text.h"

namespace tessera {

using json_fields::getArray;
using json_fields::getField;
using json_fields::getString;
using json_fields::getUnsigned;
using nlohmann::json;

namespace {

constexpr size_t kMaxBuffers = 4096;
constexpr uint64_t kMaxNumbers = 1'000'000'000;  // read in all: some seconds

enum ComponentType : uint32_t {
  kByte = 5120,
  kUbyte = 5121,
  kShort = 5122,
  kUshort = 5123,
  kUint = 5125,
  kFloat = 5126
};

size_t componentBytes(uint32_t type) {
  switch (type) {
    case kByte:
    case kUbyte:
      return 1;
    case kShort:
    case kUshort:
      return 2;
    case kUint:
    case kFloat:
      return 4;
    default:
      return 0;
  }
}

size_t componentsOfType(std::string_view type) {
  const std::pair<std::string_view, size_t> types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}};
  for (const auto& [name, count] : types)
    if (type == name) return count;
  return 0;  // matrices are of skins and are not read
}

template <class T>
T load(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

uint32_t loadUnsigned(const std::byte* at, uint32_t type) {
  return type == kUbyte ? load<uint8_t>(at) : type == kUshort ? load<uint16_t>(at) : load<uint32_t>(at);
}

float loadFloat(const std::byte* at, uint32_t type, bool isNormalised) {
  const auto scaled = [&](float value, float largest) {
    return isNormalised ? std::max(value / largest, -1.0f) : value;
  };
  switch (type) {
    case kByte:
      return scaled(load<int8_t>(at), 127);
    case kUbyte:
      return scaled(load<uint8_t>(at), 255);
    case kShort:
      return scaled(load<int16_t>(at), 32767);
    case kUshort:
      return scaled(load<uint16_t>(at), 65535);
    case kUint:
      return static_cast<float>(load<uint32_t>(at));
    default:
      return load<float>(at);
  }
}

const json* element(const json& gltf, const char* kind, uint64_t index) {
  const json* all = getArray(gltf, kind);
  return all != nullptr && index < all->size() ? &(*all)[index] : nullptr;
}

// Returns where the numbers of a part of a sparse accessor are, without whatever else the file says there.
json placeAlone(const json& object) {
  json place = json::object();
  for (const char* key : {"bufferView", "byteOffset"})
    if (const auto value = getUnsigned(object, key)) place[key] = *value;
  return place;
}

}  // namespace

struct GltfAccessors::Numbers {
  const std::byte* first = nullptr;  // null: all are 0
  size_t stride = 0;                 // bytes
  uint64_t count = 0;
  size_t components = 0;
  uint32_t type = 0;
  bool isNormalised = false;
};

void GltfAccessors::refuse(const std::string& place, const std::string& reason) const {
  files_.refuse(place, reason, kExportModelAgain);
}

GltfAccessors::GltfAccessors(const json& gltf, std::span<const std::byte> binary, const ModelAssembler& files,
                             const ModelLimits& limits)
    : gltf_(gltf), files_(files) {
  const json* buffers = getArray(gltf, "buffers");
  if (buffers == nullptr) return;
  if (buffers->size() > kMaxBuffers) refuse("buffers", "are too many");
  uint64_t total = 0;
  for (size_t i = 0; i < buffers->size(); ++i) {
    const json& buffer = (*buffers)[i];
    const std::string place = fmt::format("buffers[{}]", i);
    std::span<const std::byte> bytes;
    if (i == 0 && getField(buffer, "uri") == nullptr) {
      bytes = binary;
    } else {
      bytes = loaded_.emplace_back(loadBuffer(buffer, i));
      total += bytes.size();
      if (total > limits.fileBytes) {
        files_.refuse(place, fmt::format("makes it larger than {} MiB", limits.fileBytes >> 20),
                      "export it with fewer triangles, or smaller textures");
      }
    }
    const auto length = getUnsigned(buffer, "byteLength");
    if (!length || *length > bytes.size()) refuse(place, "is cut off");
    buffers_.push_back(bytes.first(*length));
  }
}

std::vector<std::byte> GltfAccessors::loadBuffer(const json& buffer, size_t number) const {
  const std::string place = fmt::format("buffers[{}]", number);
  const std::string* uri = getString(buffer, "uri");
  if (uri == nullptr) refuse(place, "is missing");
  if (isDataUri(*uri)) {
    auto embedded = decodeDataUri(*uri);
    if (!embedded) refuse(place, "has data that is not base64");
    return std::move(*embedded);
  }
  const std::string shown = uri->substr(0, 200);
  if (isOfNetwork(*uri)) {
    files_.refuse(place, fmt::format("asks for {}, and nothing is fetched for a model", shown),
                  "export it with all it needs, as GLB");
  }
  std::optional<Bytes> bytes = files_.read(*uri);
  if (!bytes) files_.refuse(place, fmt::format("needs {}", shown), "put that file beside the model");
  return std::move(*bytes);
}

std::span<const std::byte> GltfAccessors::view(uint64_t index) const {
  const std::string place = fmt::format("bufferViews[{}]", index);
  const json* view = element(gltf_, "bufferViews", index);
  if (view == nullptr) refuse(place, "is missing");
  const auto buffer = getUnsigned(*view, "buffer"), length = getUnsigned(*view, "byteLength");
  const uint64_t offset = getUnsigned(*view, "byteOffset").value_or(0);
  if (!buffer || *buffer >= buffers_.size() || !length) refuse(place, "names no bytes");
  const std::span<const std::byte> bytes = buffers_[*buffer];
  if (offset > bytes.size() || *length > bytes.size() - offset) refuse(place, "is beyond its buffer");
  return bytes.subspan(offset, *length);
}

uint64_t GltfAccessors::count(uint64_t index) const {
  const json* accessor = element(gltf_, "accessors", index);
  const auto count = accessor == nullptr ? std::nullopt : getUnsigned(*accessor, "count");
  if (!count) refuse(fmt::format("accessors[{}]", index), "has no count");
  return *count;
}

// `accessor`: also the indices or values of a sparse one.
GltfAccessors::Numbers GltfAccessors::locate(const json& accessor, const std::string& place) const {
  Numbers numbers;
  const std::string* type = getString(accessor, "type");
  numbers.components = type == nullptr ? 0 : componentsOfType(*type);
  numbers.type = getUnsigned(accessor, "componentType").value_or(0);
  numbers.count = getUnsigned(accessor, "count").value_or(0);
  numbers.isNormalised = json_fields::getBoolean(accessor, "normalized").value_or(false);
  const size_t size = numbers.components * componentBytes(numbers.type);
  if (size == 0) refuse(place, "has a type that is not read");
  if (getField(accessor, "bufferView") == nullptr || numbers.count == 0) return numbers;
  const auto number = getUnsigned(accessor, "bufferView");
  if (!number) refuse(place, "names no buffer view");
  const std::span<const std::byte> bytes = view(*number);
  const uint64_t offset = getUnsigned(accessor, "byteOffset").value_or(0);
  numbers.stride = getUnsigned((*getArray(gltf_, "bufferViews"))[*number], "byteStride").value_or(0);
  if (numbers.stride == 0) numbers.stride = size;
  if (offset > bytes.size() || size > bytes.size() - offset ||
      numbers.count - 1 > (bytes.size() - offset - size) / numbers.stride) {
    refuse(place, "is beyond its buffer");
  }
  numbers.first = bytes.data() + offset;
  return numbers;
}

std::vector<float> GltfAccessors::floats(uint64_t index, size_t components, std::span<const uint32_t> elements,
                                         float otherwise) const {
  const std::string place = fmt::format("accessors[{}]", index);
  const uint64_t count = this->count(index);
  const json& accessor = *element(gltf_, "accessors", index);
  const Numbers numbers = locate(accessor, place);
  std::vector<float> values(elements.size() * components, otherwise);
  spend(values.size());
  const size_t read = std::min(components, numbers.components), step = componentBytes(numbers.type);
  const auto copy = [&](const Numbers& from, uint64_t element, size_t to) {
    for (size_t c = 0; c < read; ++c) {
      values[to * components + c] = from.first == nullptr ? 0
                                                          : loadFloat(from.first + element * from.stride + c * step,
                                                                      numbers.type, numbers.isNormalised);
    }
  };
  const std::vector<uint32_t> replaced = sparseIndices(accessor, place);
  Numbers replacing;
  if (!replaced.empty()) {
    json what = placeAlone(accessor["sparse"]["values"]);
    what["type"] = accessor["type"];
    what["componentType"] = accessor["componentType"];
    what["count"] = replaced.size();
    replacing = locate(what, place + ".sparse.values");
  }
  for (size_t i = 0; i < elements.size(); ++i) {
    CHECK(elements[i] < count);
    const auto other = std::lower_bound(replaced.begin(), replaced.end(), elements[i]);
    if (other != replaced.end() && *other == elements[i]) {
      copy(replacing, static_cast<uint64_t>(other - replaced.begin()), i);
    } else {
      copy(numbers, elements[i], i);
    }
  }
  return values;
}

// Returns the elements that a sparse accessor replaces, in ascending order; none if it is not sparse.
std::vector<uint32_t> GltfAccessors::sparseIndices(const json& accessor, const std::string& place) const {
  const json* sparse = getField(accessor, "sparse");
  if (sparse == nullptr) return {};
  const json* where = getField(*sparse, "indices");
  const json* what = getField(*sparse, "values");
  const auto count = getUnsigned(*sparse, "count");
  if (where == nullptr || what == nullptr || !count || !getUnsigned(*where, "bufferView") ||
      !getUnsigned(*what, "bufferView")) {
    refuse(place, "has a sparse part that is cut off");
  }
  json indices = placeAlone(*where);
  indices["componentType"] = getUnsigned(*where, "componentType").value_or(0);
  indices["type"] = "SCALAR";
  indices["count"] = *count;
  std::vector<uint32_t> elements = integers(indices, place + ".sparse.indices");
  if (!std::is_sorted(elements.begin(), elements.end())) refuse(place, "has sparse indices that do not ascend");
  return elements;
}

std::vector<uint32_t> GltfAccessors::integers(const json& accessor, const std::string& place) const {
  const Numbers numbers = locate(accessor, place);
  if (numbers.components != 1 || (numbers.type != kUbyte && numbers.type != kUshort && numbers.type != kUint)) {
    refuse(place, "has no unsigned integers");
  }
  spend(numbers.count);
  std::vector<uint32_t> values(numbers.count, 0);
  if (numbers.first == nullptr) return values;
  for (uint64_t i = 0; i < numbers.count; ++i) {
    values[i] = loadUnsigned(numbers.first + i * numbers.stride, numbers.type);
  }
  return values;
}

std::vector<uint32_t> GltfAccessors::indices(uint64_t index) const {
  count(index);
  const json& accessor = *element(gltf_, "accessors", index);
  const std::string place = fmt::format("accessors[{}]", index);
  if (getField(accessor, "sparse") != nullptr) refuse(place, "has sparse indices, which are not read");
  return integers(accessor, place);
}

void GltfAccessors::spend(uint64_t work) const {
  spent_ += work;
  if (spent_ > kMaxNumbers) files_.refuse("accessors", "are read too often", "export it with fewer or smaller meshes");
}

}  // namespace tessera
