// Bits that mark the members of a set, and their ranks: the number of marked bits before each. Rows that are numbered
// by rank are in the order of the set regardless of which thread marked a member.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/threads.h"

namespace tessera::cpu {

inline constexpr size_t kMarkWordsPerTask = 8192;

inline void clearMarks(ThreadPool& pool, uint32_t* marks, size_t words) {
  pool.forRanges(words, kMarkWordsPerTask,
                 [&](size_t begin, size_t end) { std::fill(marks + begin, marks + end, 0u); });
}

// Sets bit `index`; several threads may do so at once.
inline void setMark(uint32_t* marks, size_t index) {
  std::atomic_ref<uint32_t> word(marks[index / 32]);
  const uint32_t bit = 1u << index % 32;
  if (!(word.load(std::memory_order_relaxed) & bit)) word.fetch_or(bit, std::memory_order_relaxed);
}

// The number of marked bits before bit `index`.
inline uint32_t rankOfMark(const uint32_t* marks, const uint32_t* ranks, size_t index) {
  const size_t word = index / 32;
  return ranks[word] + static_cast<uint32_t>(std::popcount(marks[word] & ((1u << index % 32) - 1)));
}

// Computes the rank of the first bit of each word, calls place(rank, index) for every marked bit, on any thread, and
// returns the number of marked bits.
template <class Place>
uint32_t rankMarks(ThreadPool& pool, const uint32_t* marks, uint32_t* ranks, size_t words, const Place& place) {
  // The number of bits in each range of words, then in all ranges before it.
  std::vector<uint32_t> before((words + kMarkWordsPerTask - 1) / kMarkWordsPerTask + 1);
  pool.forRanges(words, kMarkWordsPerTask, [&](size_t begin, size_t end) {
    uint32_t bits = 0;
    for (size_t word = begin; word < end; ++word) bits += static_cast<uint32_t>(std::popcount(marks[word]));
    before[begin / kMarkWordsPerTask + 1] = bits;
  });
  for (size_t piece = 1; piece < before.size(); ++piece) before[piece] += before[piece - 1];
  pool.forRanges(words, kMarkWordsPerTask, [&](size_t begin, size_t end) {
    uint32_t next = before[begin / kMarkWordsPerTask];
    for (size_t word = begin; word < end; ++word) {
      ranks[word] = next;
      for (uint32_t bits = marks[word]; bits != 0; bits &= bits - 1) {
        place(next++, 32 * word + static_cast<size_t>(std::countr_zero(bits)));
      }
    }
  });
  return before.back();
}

}  // namespace tessera::cpu
