#include "tiles/bc4.h"

#include <algorithm>

#include "base/check.h"

namespace tessera {
namespace {

// Palettes in units of 1 / 35, in which all entries are whole numbers.
constexpr int kUnit = 35;

std::array<int, 8> wholePalette(int e0, int e1) {
  std::array<int, 8> palette = {kUnit * e0, kUnit * e1};
  if (e0 > e1) {
    for (int k = 6; k >= 1; --k) palette[static_cast<size_t>(8 - k)] = kUnit / 7 * (k * e0 + (7 - k) * e1);
  } else {
    for (int k = 4; k >= 1; --k) palette[static_cast<size_t>(6 - k)] = kUnit / 5 * (k * e0 + (5 - k) * e1);
    palette[6] = 0;
    palette[7] = kUnit * 255;
  }
  return palette;
}

struct Choice {
  int64_t error = INT64_MAX;
  int e0 = 0, e1 = 0;
};

// How often each value occurs among the texels.
struct Counted {
  int value, count;
};

int64_t computeError(const std::array<int, 8>& palette, std::span<const Counted> values, int64_t least) {
  int64_t sum = 0;
  for (const Counted& counted : values) {
    int64_t nearest = INT64_MAX;
    for (const int entry : palette) {
      const int64_t difference = int64_t{entry} - kUnit * counted.value;
      nearest = std::min(nearest, difference * difference);
    }
    sum += counted.count * nearest;
    if (sum >= least) return sum;
  }
  return sum;
}

Bc4Block assemble(const Bc4Texels& texels, int e0, int e1) {
  const std::array<int, 8> palette = wholePalette(e0, e1);
  uint64_t indices = 0;
  for (size_t i = 0; i < texels.size(); ++i) {
    const int value = kUnit * texels[i];
    size_t best = 0;
    for (size_t k = 1; k < palette.size(); ++k)
      if (std::abs(palette[k] - value) < std::abs(palette[best] - value)) best = k;
    indices |= uint64_t{best} << 3 * i;
  }
  Bc4Block block = {static_cast<uint8_t>(e0), static_cast<uint8_t>(e1)};
  for (size_t byte = 0; byte < 6; ++byte) block[2 + byte] = static_cast<uint8_t>(indices >> 8 * byte);
  return block;
}

}  // namespace

std::array<float, 8> bc4Palette(uint8_t e0, uint8_t e1) {
  std::array<float, 8> palette{};
  const std::array<int, 8> whole = wholePalette(e0, e1);
  for (size_t i = 0; i < palette.size(); ++i) palette[i] = static_cast<float>(whole[i]) / kUnit;
  return palette;
}

std::array<float, 16> decodeBc4(const Bc4Block& block) {
  const std::array<float, 8> palette = bc4Palette(block[0], block[1]);
  uint64_t indices = 0;
  for (size_t byte = 0; byte < 6; ++byte) indices |= uint64_t{block[2 + byte]} << 8 * byte;
  std::array<float, 16> texels{};
  for (size_t i = 0; i < texels.size(); ++i) texels[i] = palette[indices >> 3 * i & 7];
  return texels;
}

float decodeBc4Texel(const uint8_t* block, uint32_t texel) {
  const uint32_t bit = 3 * texel, byte = 2 + bit / 8;
  // The index may reach into the next byte.
  const uint32_t bits = block[byte] | (byte < 7 ? uint32_t{block[byte + 1]} << 8 : 0);
  const int index = static_cast<int>(bits >> bit % 8 & 7), e0 = block[0], e1 = block[1];
  if (index < 2) return static_cast<float>(index == 0 ? e0 : e1);
  if (e0 > e1) return static_cast<float>((8 - index) * e0 + (index - 1) * e1) / 7;
  if (index < 6) return static_cast<float>((6 - index) * e0 + (index - 1) * e1) / 5;
  return index == 6 ? 0 : 255;
}

Bc4Block encodeBc4(const Bc4Texels& texels, Bc4Effort effort) {
  std::array<int, 256> counts{};
  for (const uint8_t texel : texels) ++counts[texel];
  std::array<Counted, 16> all{};
  size_t distinct = 0;
  for (int value = 0; value < 256; ++value)
    if (counts[static_cast<size_t>(value)] > 0) all[distinct++] = {value, counts[static_cast<size_t>(value)]};
  const std::span<const Counted> values(all.data(), distinct);
  const int low = values.front().value, high = values.back().value;
  Choice best{computeError(wholePalette(high, low), values, INT64_MAX), high, low};
  if (effort == Bc4Effort::exhaustive && best.error > 0) {
    const auto consider = [&](int e0, int e1) {
      const int64_t error = computeError(wholePalette(e0, e1), values, best.error);
      if (error < best.error) best = {error, e0, e1};
    };
    // End points may lie beyond the texels, by a few steps of the palette.
    const auto beyond = [](int value, int by) { return std::clamp(value + by, 0, 255); };
    const auto considerPairs = [&](int first, int last, int steps, bool isOther) {
      const int reach = 2 * std::max(0, last - first) / steps + 2;
      for (int lower = beyond(first, -reach); lower < last; ++lower)
        for (int upper = std::max(first, lower) + 1; upper <= beyond(last, reach); ++upper)
          isOther ? consider(lower, upper) : consider(upper, lower);
    };
    considerPairs(low, high, 7, false);
    // The other palette has 0 and 255 for nothing.
    const int first = low == 0 && distinct > 1 ? values[1].value : low;
    const int last = high == 255 && distinct > 1 ? values[distinct - 2].value : high;
    considerPairs(first, last, 5, true);
    if (first >= last) consider(last, last);
  }
  return assemble(texels, best.e0, best.e1);
}

std::vector<uint8_t> encodeBc4Image(std::span<const uint8_t> texels, uint32_t width, uint32_t height,
                                    Bc4Effort effort) {
  CHECK((width % 4 == 0 && height % 4 == 0));
  CHECK(texels.size() == size_t{width} * height);
  std::vector<uint8_t> bytes;
  bytes.reserve(texels.size() / 2);
  for (uint32_t y = 0; y < height; y += 4) {
    for (uint32_t x = 0; x < width; x += 4) {
      Bc4Texels block{};
      for (uint32_t row = 0; row < 4; ++row)
        std::copy_n(texels.begin() + static_cast<ptrdiff_t>(size_t{y + row} * width + x), 4, block.begin() + 4 * row);
      const Bc4Block encoded = encodeBc4(block, effort);
      bytes.insert(bytes.end(), encoded.begin(), encoded.end());
    }
  }
  return bytes;
}

std::vector<uint8_t> decodeBc4Image(std::span<const uint8_t> blocks, uint32_t width, uint32_t height) {
  CHECK((width % 4 == 0 && height % 4 == 0));
  CHECK(blocks.size() == size_t{width} * height / 2);
  std::vector<uint8_t> texels(size_t{width} * height);
  const uint8_t* from = blocks.data();
  for (uint32_t y = 0; y < height; y += 4) {
    for (uint32_t x = 0; x < width; x += 4, from += sizeof(Bc4Block)) {
      Bc4Block block;
      std::copy_n(from, block.size(), block.begin());
      const std::array<float, 16> decoded = decodeBc4(block);
      for (uint32_t i = 0; i < 16; ++i)
        texels[size_t{y + i / 4} * width + x + i % 4] = static_cast<uint8_t>(decoded[i] + 0.5f);
    }
  }
  return texels;
}

}  // namespace tessera
