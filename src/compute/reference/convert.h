// Conversions between the float buffers of the host and the plain double arrays of functions.h.
#pragma once

#include <algorithm>

#include "compute/host_memory.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

// The first `count` elements of a slice; an empty array for an empty slice.
inline Doubles doubles(const Slice<const float>& slice, size_t count) {
  if (!slice) return {};
  CHECK(count <= slice.count);
  const float* from = hostPointer(slice);
  return Doubles(from, from + count);
}

// The given rows of a slice with `columns` numbers per row.
inline Doubles doublesOfRows(const Slice<const float>& slice, size_t columns, const HostRows& rows) {
  if (!slice) return {};
  return doubles(slice.part(columns * rows.begin, columns * rows.count()), columns * rows.count());
}

inline Indices indices(const Slice<const uint32_t>& slice, size_t count) {
  if (!slice) return {};
  CHECK(count <= slice.count);
  return {hostPointer(slice), count};
}

// The first `rows` rows of a matrix in any layout, as a row-major array without gaps.
inline Doubles doubles(const Matrix<const float>& matrix, size_t rows) {
  Doubles values;
  if (!matrix) return values;
  values.reserve(rows * matrix.columns);
  for (size_t row = 0; row < rows; ++row)
    for (size_t column = 0; column < matrix.columns; ++column) {
      CHECK(matrix.offset(row, column) < matrix.data.count);
      values.push_back(hostPointer(matrix.data)[matrix.offset(row, column)]);
    }
  return values;
}

inline void store(const Slice<float>& slice, View values) {
  if (!slice) return;
  CHECK(values.size() <= slice.count);
  for (size_t i = 0; i < values.size(); ++i) hostPointer(slice)[i] = static_cast<float>(values[i]);
}

inline void storeRows(const Slice<float>& slice, size_t columns, const HostRows& rows, View values) {
  if (slice) store(slice.part(columns * rows.begin, columns * rows.count()), values);
}

inline void store(const Slice<uint32_t>& slice, Indices values) {
  if (!slice) return;
  CHECK(values.size() <= slice.count);
  std::copy(values.begin(), values.end(), hostPointer(slice));
}

inline void add(const Slice<float>& slice, View values) {
  CHECK(values.size() <= slice.count);
  for (size_t i = 0; i < values.size(); ++i) {
    float& element = hostPointer(slice)[i];
    element = static_cast<float>(element + values[i]);
  }
}

inline void store(const Matrix<float>& matrix, View values) {
  if (!matrix) return;
  for (size_t i = 0; i < values.size(); ++i) {
    const size_t offset = matrix.offset(i / matrix.columns, i % matrix.columns);
    CHECK(offset < matrix.data.count);
    hostPointer(matrix.data)[offset] = static_cast<float>(values[i]);
  }
}

}  // namespace tessera::reference
