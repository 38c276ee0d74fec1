// Splits libFuzzer's bytes into the files that the decoders take.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

namespace tessera {

// The first two bytes give the length of the first of several files, and so on.
class FuzzInput {
 public:
  FuzzInput(const uint8_t* data, size_t size) : rest_(reinterpret_cast<const std::byte*>(data), size) {}

  std::span<const std::byte> file() {
    uint16_t length = 0;
    if (rest_.size() >= 2) {
      std::memcpy(&length, rest_.data(), 2);
      rest_ = rest_.subspan(2);
    }
    const auto part = rest_.first(length < rest_.size() ? length : rest_.size());
    rest_ = rest_.subspan(part.size());
    return part;
  }
  std::string_view text() { return asText(file()); }
  std::span<const std::byte> rest() const { return rest_; }

  static std::string_view asText(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

 private:
  std::span<const std::byte> rest_;
};

}  // namespace tessera
