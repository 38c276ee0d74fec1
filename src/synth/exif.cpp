#include "synth/exif.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

namespace tessera {
namespace {

enum : uint16_t { kByte = 1, kAscii = 2, kShort = 3, kLong = 4, kRational = 5 };

struct Entry {
  uint16_t tag, type;
  uint32_t count;
  std::string value;  // little-endian bytes
};

void put(std::string& out, uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out.push_back(static_cast<char>(value >> (8 * i) & 0xff));
}

Entry text(uint16_t tag, const std::string& value) {
  return {tag, kAscii, static_cast<uint32_t>(value.size() + 1), value + '\0'};
}

Entry number(uint16_t tag, uint16_t type, uint32_t value) {
  std::string bytes;
  put(bytes, value, type == kByte ? 1 : type == kShort ? 2 : 4);
  return {tag, type, 1, bytes};
}

Entry rationals(uint16_t tag, const std::vector<std::pair<uint32_t, uint32_t>>& values) {
  std::string bytes;
  for (const auto& [numerator, denominator] : values) {
    put(bytes, numerator, 4);
    put(bytes, denominator, 4);
  }
  return {tag, kRational, static_cast<uint32_t>(values.size()), bytes};
}

// Encodes degrees, minutes and millionths of a second, which resolve 30 micrometres on the ground.
Entry degrees(uint16_t tag, double value) {
  constexpr uint32_t kMillion = 1000000;
  const uint64_t total = static_cast<uint64_t>(std::llround(std::abs(value) * 3600 * kMillion));
  return rationals(tag, {{static_cast<uint32_t>(total / (3600ull * kMillion)), 1},
                         {static_cast<uint32_t>(total / (60ull * kMillion) % 60), 1},
                         {static_cast<uint32_t>(total % (60ull * kMillion)), kMillion}});
}

size_t directorySize(const std::vector<Entry>& entries) {
  size_t size = 2 + 12 * entries.size() + 4;
  for (const Entry& e : entries)
    if (e.value.size() > 4) size += e.value.size() + e.value.size() % 2;
  return size;
}

// Encodes a directory that begins `at` bytes into the TIFF block: entries, then values that do not fit into them.
std::string directory(const std::vector<Entry>& entries, size_t at) {
  std::string head, tail;
  put(head, entries.size(), 2);
  const size_t tailAt = at + 2 + 12 * entries.size() + 4;
  for (const Entry& e : entries) {
    put(head, e.tag, 2);
    put(head, e.type, 2);
    put(head, e.count, 4);
    if (e.value.size() <= 4) {
      head += e.value;
      head.append(4 - e.value.size(), '\0');
    } else {
      put(head, tailAt + tail.size(), 4);
      tail += e.value;
      if (tail.size() % 2 != 0) tail.push_back('\0');
    }
  }
  put(head, 0, 4);
  return head + tail;
}

// At most what EXIF can state, about four seconds.
uint32_t exposureNanoseconds(const ExifFields& f) {
  constexpr double kMax = std::numeric_limits<uint32_t>::max();
  return static_cast<uint32_t>(std::clamp(std::round(2e6 * std::exp2(f.exposure - f.isoStops)), 1.0, kMax));
}

}  // namespace

Bytes encodeExif(const ExifFields& f) {
  const int second = static_cast<int>(f.seconds);
  const std::string when = fmt::format("2024:06:{:02d} {:02d}:{:02d}:{:02d}", 21 + second / 43200 % 9,
                                       10 + second / 3600 % 12, second / 60 % 60, second % 60);
  const auto thousandths = [](double value) { return static_cast<uint32_t>(std::llround(value * 1000)); };
  std::vector<Entry> main{text(0x010f, "tessera"), text(0x0110, "synthetic drone"), number(0x0112, kShort, 1),
                          text(0x0132, when),      number(0x8769, kLong, 0),        number(0x8825, kLong, 0)};
  const std::vector<Entry> camera{rationals(0x829a, {{exposureNanoseconds(f), 1000000000}}),
                                  rationals(0x829d, {{28, 10}}),
                                  number(0x8827, kShort, 100u << f.isoStops),
                                  text(0x9003, when),
                                  rationals(0x920a, {{thousandths(f.focalLength35 / 5.6), 1000}}),
                                  number(0xa405, kShort, static_cast<uint32_t>(std::lround(f.focalLength35)))};
  const std::vector<Entry> gps{{0x0000, kByte, 4, std::string("\2\3\0\0", 4)},
                               text(0x0001, f.gps.latitude < 0 ? "S" : "N"),
                               degrees(0x0002, f.gps.latitude),
                               text(0x0003, f.gps.longitude < 0 ? "W" : "E"),
                               degrees(0x0004, f.gps.longitude),
                               number(0x0005, kByte, f.gps.altitude < 0 ? 1 : 0),
                               rationals(0x0006, {{thousandths(std::abs(f.gps.altitude)), 1000}})};
  const size_t cameraAt = 8 + directorySize(main), gpsAt = cameraAt + directorySize(camera);
  main[4] = number(0x8769, kLong, static_cast<uint32_t>(cameraAt));
  main[5] = number(0x8825, kLong, static_cast<uint32_t>(gpsAt));

  std::string block("Exif\0\0II*\0", 10);
  put(block, 8, 4);
  block += directory(main, 8) + directory(camera, cameraAt) + directory(gps, gpsAt);
  const auto bytes = std::as_bytes(std::span(block));
  return {bytes.begin(), bytes.end()};
}

}  // namespace tessera
