#include "base/safetensors.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "base/check.h"
#include "base/error.h"

namespace tessera {
namespace {

using nlohmann::json;

constexpr size_t kMaximumHeader = size_t{100} << 20;  // the limit of the format's own reader

struct TypeRow {
  TensorType type;
  const char* name;
  size_t bytes;
};
constexpr TypeRow kTypes[] = {{TensorType::f64, "F64", 8}, {TensorType::f32, "F32", 4}, {TensorType::f16, "F16", 2},
                              {TensorType::i64, "I64", 8}, {TensorType::i32, "I32", 4}, {TensorType::u32, "U32", 4},
                              {TensorType::u16, "U16", 2}, {TensorType::u8, "U8", 1}};

const TypeRow& typeRow(TensorType type) {
  for (const TypeRow& row : kTypes) {
    if (row.type == type) return row;
  }
  CHECK(false);
  return kTypes[0];
}

struct Entry {
  std::string name;
  TensorType type;
  std::vector<int64_t> shape;
  size_t begin, end;
};

// Replaces get<T>(), because nlohmann throws on a wrong type and wraps negative numbers.
std::optional<uint64_t> toUnsigned(const json& value) {
  if (!value.is_number_unsigned()) return std::nullopt;
  return value.get<uint64_t>();
}

std::optional<Entry> entryFrom(const std::string& name, const json& value, size_t dataBytes) {
  if (!value.is_object() || !value.contains("dtype") || !value.contains("shape") || !value.contains("data_offsets")) {
    return std::nullopt;
  }
  const json &dtype = value["dtype"], &shape = value["shape"], &offsets = value["data_offsets"];
  if (!dtype.is_string() || !shape.is_array() || !offsets.is_array() || offsets.size() != 2) return std::nullopt;
  const auto row = std::find_if(std::begin(kTypes), std::end(kTypes),
                                [&](const TypeRow& one) { return dtype.get_ref<const std::string&>() == one.name; });
  if (row == std::end(kTypes)) return std::nullopt;
  const auto begin = toUnsigned(offsets[0]), end = toUnsigned(offsets[1]);
  if (!begin || !end || *begin > *end || *end > dataBytes) return std::nullopt;
  Entry entry{name, row->type, {}, *begin, *end};
  uint64_t bytes = row->bytes;
  bool isEmpty = false;
  for (const json& side : shape) {
    const auto extent = toUnsigned(side);
    if (!extent || *extent > static_cast<uint64_t>(INT64_MAX)) return std::nullopt;
    if (*extent == 0) isEmpty = true;
    if (*extent != 0 && __builtin_mul_overflow(bytes, *extent, &bytes)) return std::nullopt;
    entry.shape.push_back(static_cast<int64_t>(*extent));
  }
  if ((isEmpty ? 0 : bytes) != *end - *begin) return std::nullopt;
  return entry;
}

}  // namespace

size_t bytesPerElement(TensorType type) {
  return typeRow(type).bytes;
}

int64_t TensorView::elements() const {
  return static_cast<int64_t>(bytes.size() / bytesPerElement(type));
}

const TensorView& Safetensors::require(const fs::path& path, const std::string& name, TensorType type) const {
  const auto tensor = tensors.find(name);
  if (tensor == tensors.end()) {
    throw Error(path.string(), name, "there is no such tensor (the file has " + std::to_string(tensors.size()) + ")",
                "use a file written for this purpose");
  }
  if (tensor->second.type != type) {
    throw Error(path.string(), name,
                std::string("the tensor holds ") + typeRow(tensor->second.type).name + " where " + typeRow(type).name +
                    " is needed",
                "convert the file");
  }
  return tensor->second;
}

std::optional<Safetensors> decodeSafetensors(Bytes bytes) {
  if (bytes.size() < 8) return std::nullopt;
  uint64_t headerBytes = 0;
  for (int i = 7; i >= 0; --i) headerBytes = headerBytes << 8 | static_cast<uint8_t>(bytes[static_cast<size_t>(i)]);
  if (headerBytes > kMaximumHeader || headerBytes > bytes.size() - 8) return std::nullopt;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()) + 8, headerBytes);
  const json header = json::parse(text, nullptr, false);
  if (!header.is_object()) return std::nullopt;

  const size_t dataStart = 8 + headerBytes, dataBytes = bytes.size() - dataStart;
  Safetensors file;
  std::vector<Entry> entries;
  for (const auto& [name, value] : header.items()) {
    if (name == "__metadata__") {
      if (!value.is_object()) return std::nullopt;
      for (const auto& [key, text] : value.items()) {
        if (!text.is_string()) return std::nullopt;
        file.metadata[key] = text.get<std::string>();
      }
      continue;
    }
    auto entry = entryFrom(name, value, dataBytes);
    if (!entry) return std::nullopt;
    entries.push_back(std::move(*entry));
  }
  std::sort(entries.begin(), entries.end(),
            [](const Entry& a, const Entry& b) { return std::pair(a.begin, a.end) < std::pair(b.begin, b.end); });
  for (size_t i = 1; i < entries.size(); ++i) {
    if (entries[i].begin < entries[i - 1].end) return std::nullopt;
  }

  // The allocation is aligned for any type, so a tensor is aligned if its offset is. All other tensors are copied to
  // the end of the storage.
  file.storage = std::move(bytes);
  const auto isAligned = [&](const Entry& entry) {
    return (dataStart + entry.begin) % bytesPerElement(entry.type) == 0;
  };
  size_t total = file.storage.size();
  for (const Entry& entry : entries) {
    if (!isAligned(entry)) total = (total + 7) / 8 * 8 + (entry.end - entry.begin);
  }
  size_t free = file.storage.size();
  file.storage.resize(total);
  for (Entry& entry : entries) {
    size_t start = dataStart + entry.begin;
    const size_t length = entry.end - entry.begin;
    if (!isAligned(entry)) {
      free = (free + 7) / 8 * 8;
      if (length > 0) std::memcpy(file.storage.data() + free, file.storage.data() + start, length);
      start = free;
      free += length;
    }
    file.tensors[entry.name] = {entry.type, std::move(entry.shape), {file.storage.data() + start, length}};
  }
  return file;
}

Safetensors readSafetensors(const fs::path& path) {
  auto file = decodeSafetensors(readFile(path));
  if (!file) {
    throw Error(path.string(), "", "is not a well-formed safetensors file", "copy it again; it may be cut short");
  }
  return std::move(*file);
}

Bytes encodeSafetensors(const std::map<std::string, TensorView>& tensors,
                        const std::map<std::string, std::string>& metadata) {
  // Padding tensors to their alignment would leave gaps, which readers of the format reject. Sorted by decreasing
  // element size they need none: the size of each tensor is a multiple of its own alignment.
  std::vector<std::pair<std::string, const TensorView*>> order;
  for (const auto& [name, tensor] : tensors) order.emplace_back(name, &tensor);
  std::stable_sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
    return bytesPerElement(a.second->type) > bytesPerElement(b.second->type);
  });

  json header = json::object();
  if (!metadata.empty()) header["__metadata__"] = metadata;
  size_t offset = 0;
  for (const auto& [name, tensor] : order) {
    int64_t elements = 1;
    for (const int64_t side : tensor->shape) elements *= side;
    CHECK(static_cast<size_t>(elements) * bytesPerElement(tensor->type) == tensor->bytes.size());
    header[name] = {{"dtype", typeRow(tensor->type).name},
                    {"shape", tensor->shape},
                    {"data_offsets", {offset, offset + tensor->bytes.size()}}};
    offset += tensor->bytes.size();
  }
  std::string text = header.dump(-1, ' ', false, json::error_handler_t::replace);
  text.resize((text.size() + 7) / 8 * 8, ' ');

  Bytes file;
  file.reserve(8 + text.size() + offset);  // rather than filled with zeros, which takes as long as the copies
  for (size_t i = 0; i < 8; ++i) file.push_back(static_cast<std::byte>(static_cast<uint64_t>(text.size()) >> (8 * i)));
  const auto append = [&](std::span<const std::byte> bytes) { file.insert(file.end(), bytes.begin(), bytes.end()); };
  append(std::as_bytes(std::span(text)));
  for (const auto& [name, tensor] : order) append(tensor->bytes);
  return file;
}

}  // namespace tessera
