// Counter-based random numbers: a value is a function of (seed, stream, index) alone, so that any part of any step can
// be reproduced, on any number of threads and after any resume. Numbers are mixed by the finaliser of SplitMix64
// (Steele, Lea and Flood, 2014).
#pragma once

#include <cstdint>

namespace tessera {

inline uint64_t mix64(uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

struct RandomStream {
  uint64_t key;

  constexpr explicit RandomStream(uint64_t seedAndStream) : key(seedAndStream) {}
  RandomStream(uint64_t seed, uint64_t stream) : key(mix64(mix64(seed) ^ (stream * 0xd1342543de82ef95ull))) {}

  uint64_t bits(uint64_t index) const { return mix64(key ^ (index * 0x2545f4914f6cdd1dull)); }
  uint32_t bits32(uint64_t index) const { return static_cast<uint32_t>(bits(index) >> 32); }
  // Uniform in [0, 1), with 24 bits, exact in float.
  float uniform(uint64_t index) const { return static_cast<float>(bits(index) >> 40) * 0x1p-24f; }
  double uniformDouble(uint64_t index) const { return static_cast<double>(bits(index) >> 11) * 0x1p-53; }
  // Uniform in [0, n), unbiased to 2^-32.
  uint32_t below(uint64_t index, uint32_t n) const {
    return static_cast<uint32_t>((static_cast<uint64_t>(bits32(index)) * n) >> 32);
  }
};

}  // namespace tessera
