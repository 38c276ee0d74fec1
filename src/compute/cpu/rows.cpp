#include "compute/rows.h"

#include <algorithm>
#include <cstring>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {

void run(Context& context, const GatherRows& a) {
  const uint32_t* source = hostPointer(a.source);
  const float* input = hostPointer(a.input.data);
  float* output = hostPointer(a.output.data);
  const uint32_t group = a.input.groupWidth ? a.input.groupWidth : a.input.columns;
  CHECK(a.input.columns == a.output.columns);
  CHECK(a.input.groupWidth == a.output.groupWidth);
  const size_t groups = a.input.columns / group, rows = hostCount(a.rows);
  constexpr size_t kRange = 8192;
  const size_t ranges = (rows + kRange - 1) / kRange;
  context.pool.run(groups * ranges, [&](size_t task, int) {
    const size_t g = task / ranges, begin = task % ranges * kRange, end = std::min(rows, begin + kRange);
    const float* from = input + g * a.input.groupStride;
    float* to = output + g * a.output.groupStride;
    if (group == 2) {
      for (size_t i = begin; i < end; ++i) {
        std::memcpy(to + i * a.output.rowStride, from + size_t{source[i]} * a.input.rowStride, 8);
      }
    } else {
      for (size_t i = begin; i < end; ++i) {
        for (uint32_t c = 0; c < group; ++c) {
          to[i * a.output.rowStride + c] = from[size_t{source[i]} * a.input.rowStride + c];
        }
      }
    }
  });
}

void run(Context& context, const ScatterRows& a) {
  const uint32_t* source = hostPointer(a.source);
  const float* input = hostPointer(a.input.data);
  float* output = hostPointer(a.output.data);
  CHECK(a.input.columns == a.output.columns);
  CHECK(a.input.groupWidth == a.output.groupWidth);
  const uint32_t group = a.input.groupWidth ? a.input.groupWidth : a.input.columns;
  const size_t groups = a.input.columns / group, rows = hostCount(a.rows);
  constexpr size_t kRowsPerTask = 4096;
  const size_t ranges = (rows + kRowsPerTask - 1) / kRowsPerTask;
  context.pool.run(groups * ranges, [&](size_t task, int) {
    const size_t g = task / ranges, begin = task % ranges * kRowsPerTask, end = std::min(rows, begin + kRowsPerTask);
    const float* const from = input + g * a.input.groupStride;
    float* const to = output + g * a.output.groupStride;
    for (size_t i = begin; i < end; ++i) {
      std::memcpy(to + size_t{source[i]} * a.output.rowStride, from + i * a.input.rowStride, group * sizeof(float));
    }
  });
}

void run(Context& context, const AddColumns& a) {
  CHECK(a.input.columns == a.output.columns);
  const float* input = hostPointer(a.input.data);
  float* output = hostPointer(a.output.data);
  constexpr size_t kRowsPerTask = 2048;
  context.pool.forRanges(hostCount(a.rows), kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t row = begin; row < end; ++row) {
      for (uint32_t c = 0; c < a.input.columns; ++c) {
        output[a.output.offset(row, c)] += input[a.input.offset(row, c)];
      }
    }
  });
}

}  // namespace tessera::cpu
