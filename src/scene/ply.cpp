#include "scene/ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>

#include "base/error.h"

namespace tessera {
namespace {

enum class Scalar { i8, u8, i16, u16, i32, u32, f32, f64 };
constexpr std::array<size_t, 8> kScalarBytes = {1, 1, 2, 2, 4, 4, 4, 8};

size_t scalarSize(Scalar type) {
  return kScalarBytes[static_cast<size_t>(type)];
}

std::optional<Scalar> scalarFromName(std::string_view name) {
  constexpr std::array<std::array<std::string_view, 2>, 8> kNames = {{{"char", "int8"},
                                                                      {"uchar", "uint8"},
                                                                      {"short", "int16"},
                                                                      {"ushort", "uint16"},
                                                                      {"int", "int32"},
                                                                      {"uint", "uint32"},
                                                                      {"float", "float32"},
                                                                      {"double", "float64"}}};
  for (size_t i = 0; i < kNames.size(); ++i) {
    if (name == kNames[i][0] || name == kNames[i][1]) return static_cast<Scalar>(i);
  }
  return std::nullopt;
}

enum Field { fieldX, fieldY, fieldZ, fieldRed, fieldGreen, fieldBlue, fieldError, fieldNone };

struct Property {
  Field field = fieldNone;
  Scalar type = Scalar::f32;
};

struct Header {
  bool ascii = false;
  uint64_t points = 0;
  std::vector<Property> properties;
  size_t bytes = 0;  // up to and including "end_header\n"
};

std::vector<std::string_view> splitWords(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    const size_t begin = line.find_first_not_of(" \t\r\n");
    if (begin == line.npos) return words;
    line.remove_prefix(begin);
    const size_t length = std::min(line.find_first_of(" \t\r\n"), line.size());
    words.push_back(line.substr(0, length));
    line.remove_prefix(length);
  }
}

// Removes the next line from `text` and returns it.
std::optional<std::string_view> nextLine(std::string_view& text) {
  const size_t end = text.find('\n');
  if (end == text.npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  return line;
}

std::optional<Header> decodeHeader(std::string_view text, std::string& reason) {
  Header header;
  const std::string_view whole = text;
  bool inVertices = false, sawVertices = false, sawFormat = false;
  for (int lines = 0; lines < 1000; ++lines) {
    const auto line = nextLine(text);
    if (!line) break;
    const auto words = splitWords(*line);
    if (lines == 0) {
      if (words.size() == 1 && words[0] == "ply") continue;
      reason = "does not begin with 'ply'";
      return std::nullopt;
    }
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") {
      header.bytes = whole.size() - text.size();
      unsigned fields = 0;
      for (const Property& property : header.properties) fields |= 1u << property.field;
      if (sawFormat && sawVertices && (fields & 7u) == 7u) return header;
      reason = "has no vertex element with x, y and z";
      return std::nullopt;
    }
    if (words[0] == "format" && words.size() == 3) {
      sawFormat = true;
      header.ascii = words[1] == "ascii";
      if (!header.ascii && words[1] != "binary_little_endian") {
        reason = fmt::format("format {} is not read, only ascii and binary_little_endian", words[1]);
        return std::nullopt;
      }
    } else if (words[0] == "element" && words.size() == 3) {
      inVertices = words[1] == "vertex" && !sawVertices;
      if (!inVertices && !sawVertices) {
        reason = fmt::format("element {} stands before the vertices", words[1]);
        return std::nullopt;
      }
      if (inVertices) {
        sawVertices = true;
        const auto [end, error] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), header.points);
        if (error != std::errc() || end != words[2].data() + words[2].size()) {
          reason = "the number of vertices is not a number";
          return std::nullopt;
        }
      }
    } else if (words[0] == "property" && inVertices) {
      const auto type = words.size() == 3 ? scalarFromName(words[1]) : std::nullopt;
      if (!type) {
        reason = "a vertex property is not a scalar of a known type";
        return std::nullopt;
      }
      constexpr std::array<std::string_view, 7> kFields = {"x", "y", "z", "red", "green", "blue", "error"};
      const auto match = std::find(kFields.begin(), kFields.end(), words[2]);
      header.properties.push_back({static_cast<Field>(match - kFields.begin()), *type});
      if (header.properties.size() > 256) {
        reason = "has more than 256 vertex properties";
        return std::nullopt;
      }
    }
  }
  reason = "the header has no end";
  return std::nullopt;
}

template <class T>
double loadAs(const std::byte* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return static_cast<double>(value);
}

double load(Scalar type, const std::byte* bytes) {
  switch (type) {
    case Scalar::i8:
      return loadAs<int8_t>(bytes);
    case Scalar::u8:
      return loadAs<uint8_t>(bytes);
    case Scalar::i16:
      return loadAs<int16_t>(bytes);
    case Scalar::u16:
      return loadAs<uint16_t>(bytes);
    case Scalar::i32:
      return loadAs<int32_t>(bytes);
    case Scalar::u32:
      return loadAs<uint32_t>(bytes);
    case Scalar::f32:
      return loadAs<float>(bytes);
    case Scalar::f64:
      return loadAs<double>(bytes);
  }
  return 0;
}

void set(SparsePoint& point, const Property& property, double value) {
  switch (property.field) {
    case fieldX:
    case fieldY:
    case fieldZ:
      point.xInWorld[property.field - fieldX] = value;
      break;
    case fieldRed:
    case fieldGreen:
    case fieldBlue: {
      const double byte = property.type == Scalar::f32 || property.type == Scalar::f64 ? value * 255 : value;
      point.colour[static_cast<size_t>(property.field - fieldRed)] =
          byte > 0 ? static_cast<uint8_t>(std::lround(std::min(byte, 255.0))) : uint8_t{0};
      break;
    }
    case fieldError:
      point.error = std::abs(value) < 3e38 ? static_cast<float>(value) : 0.0f;
      break;
    case fieldNone:
      break;
  }
}

}  // namespace

std::optional<std::vector<SparsePoint>> decodePly(std::span<const std::byte> bytes, std::string* reasonOut) {
  std::string ignored;
  std::string& reason = reasonOut != nullptr ? *reasonOut : ignored;
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const auto header = decodeHeader(text, reason);
  if (!header) return std::nullopt;
  text.remove_prefix(header->bytes);

  size_t stride = 0;
  for (const Property& property : header->properties) stride += header->ascii ? 2 : scalarSize(property.type);
  // The last ASCII number need not be followed by a space.
  if (header->points > (text.size() + 1) / stride) {
    reason = fmt::format("claims {} vertices, more than {} bytes can hold", header->points, text.size());
    return std::nullopt;
  }
  std::vector<SparsePoint> points(static_cast<size_t>(header->points));
  if (!header->ascii) {
    const std::byte* at = bytes.data() + header->bytes;
    if (points.size() * stride > text.size()) {
      reason = "ends early";
      return std::nullopt;
    }
    for (SparsePoint& point : points) {
      for (const Property& property : header->properties) {
        set(point, property, load(property.type, at));
        at += scalarSize(property.type);
      }
    }
    return points;
  }
  const char* at = text.data();
  const char* const end = at + text.size();
  for (SparsePoint& point : points) {
    for (const Property& property : header->properties) {
      while (at < end && (*at == ' ' || *at == '\t' || *at == '\r' || *at == '\n')) ++at;
      double value = 0;
      const auto [next, error] = std::from_chars(at, end, value);
      if (error == std::errc::invalid_argument) {
        reason = fmt::format("byte {}: expected a number", header->bytes + static_cast<size_t>(at - text.data()));
        return std::nullopt;
      }
      at = next;
      set(point, property, value);
    }
  }
  return points;
}

std::vector<SparsePoint> readPly(const fs::path& path) {
  std::string reason;
  auto points = decodePly(readFile(path), &reason);
  if (!points) throw Error(path.string(), "", reason, "give an ascii or binary_little_endian PLY with x, y and z");
  return std::move(*points);
}

Bytes encodePly(std::span<const SparsePoint> points) {
  const std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\n"
      "property double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float error\n"
      "end_header\n",
      points.size());
  constexpr size_t kStride = 3 * sizeof(double) + 3 + sizeof(float);
  Bytes bytes(header.size() + kStride * points.size());
  std::memcpy(bytes.data(), header.data(), header.size());
  std::byte* at = bytes.data() + header.size();
  for (const SparsePoint& point : points) {
    std::memcpy(at, point.xInWorld.data(), 24);
    std::memcpy(at + 24, point.colour.data(), 3);
    std::memcpy(at + 27, &point.error, 4);
    at += kStride;
  }
  return bytes;
}

}  // namespace tessera
