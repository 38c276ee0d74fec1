// Device memory: Array owns it, and Slice refers to a part of it. Its contents are accessed through Device::write and
// Device::read only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "base/check.h"

namespace tessera {

// One allocation on one device. Each device derives its own.
class Memory {
 public:
  explicit Memory(size_t bytes) : bytes_(bytes) {}
  virtual ~Memory() = default;
  size_t bytes() const { return bytes_; }

 private:
  size_t bytes_;
};

// A non-owning view of `count` elements of T that begins at element `first` of an allocation. An empty slice omits an
// optional argument of an operation.
template <class T>
struct Slice {
  using Element = std::remove_const_t<T>;
  Memory* memory = nullptr;
  size_t first = 0;
  size_t count = 0;

  Slice() = default;
  Slice(Memory* m, size_t f, size_t c) : memory(m), first(f), count(c) {
    CHECK((f + c) * sizeof(T) <= (m ? m->bytes() : 0));
  }
  // Slice<T> → Slice<const T>
  template <class U>
  requires(std::is_same_v<T, const U>) Slice(const Slice<U>& other)
      : memory(other.memory), first(other.first), count(other.count) {}

  explicit operator bool() const { return memory != nullptr; }
  Slice part(size_t from, size_t length) const {
    CHECK(from + length <= count);
    return Slice(memory, first + from, length);
  }
};

// Owns `count` elements on a device, initially zero; created by Device::array<T>(). Move-only.
template <class T>
class Array {
 public:
  Array() = default;
  Array(std::unique_ptr<Memory> memory, size_t count) : memory_(std::move(memory)), count_(count) {}

  size_t size() const { return count_; }
  Slice<T> all() { return count_ ? Slice<T>(memory_.get(), 0, count_) : Slice<T>(); }
  Slice<const T> all() const { return count_ ? Slice<const T>(memory_.get(), 0, count_) : Slice<const T>(); }
  Slice<T> part(size_t first, size_t count) { return all().part(first, count); }
  Slice<const T> part(size_t first, size_t count) const { return all().part(first, count); }
  operator Slice<T>() { return all(); }
  operator Slice<const T>() const { return all(); }

 private:
  std::unique_ptr<Memory> memory_;
  size_t count_ = 0;
};

// The number of elements that an operation works on. A size that only the device knows stays in a device counter: the
// operation works on min(counter[0], capacity) elements, or on `capacity` elements without a counter. Buffers have
// `capacity` elements. An operation documented to work on part of the rows processes only rows
// [first[0], min(counter[0], capacity)).
struct Count {
  uint32_t capacity = 0;
  Slice<const uint32_t> counter = {};  // optional, 1 element
  Slice<const uint32_t> first = {};    // optional, 1 element
};

// A matrix of `columns` columns, with one row per sample, in one of two layouts:
//   row-major    element (row, column) at row × rowStride + column                                  (groupWidth 0)
//   grouped      element (row, column) at (column / groupWidth) × groupStride + row × rowStride + column % groupWidth
// The hash grid writes the grouped layout: one plane per level, with `groupWidth` features per plane.
template <class T>
struct Matrix {
  Slice<T> data;
  uint32_t columns = 0;
  uint32_t rowStride = 0;
  uint32_t groupWidth = 0;
  size_t groupStride = 0;

  Matrix() = default;
  Matrix(Slice<T> slice, uint32_t width) : data(slice), columns(width), rowStride(width) {}
  Matrix(Slice<T> slice, uint32_t width, uint32_t stride) : data(slice), columns(width), rowStride(stride) {}
  template <class U>
  requires(std::is_same_v<T, const U>) Matrix(const Matrix<U>& other)
      : data(other.data),
        columns(other.columns),
        rowStride(other.rowStride),
        groupWidth(other.groupWidth),
        groupStride(other.groupStride) {}

  // The number of rows to allocate per plane for at least `rows` rows: planes a power of two apart would all map to the
  // same few lines of a cache.
  static size_t rowsOfPlane(size_t rows) { return (rows + 63) / 64 * 64 + 24; }
  static Matrix grouped(Slice<T> slice, uint32_t columns, uint32_t width, size_t rows) {
    Matrix m(slice, columns, width);
    m.groupWidth = width;
    m.groupStride = rows * width;
    return m;
  }
  // Columns [firstColumn, firstColumn + count) of a row-major matrix.
  Matrix columnRange(uint32_t firstColumn, uint32_t count) const {
    CHECK(groupWidth == 0u);
    return Matrix(data.part(firstColumn, data.count - firstColumn), count, rowStride);
  }

  size_t offset(size_t row, size_t column) const {
    return groupWidth == 0 ? row * rowStride + column
                           : column / groupWidth * groupStride + row * rowStride + column % groupWidth;
  }
  // The rows from `firstRow` on.
  Matrix rowsFrom(size_t firstRow) const {
    Matrix m = *this;
    m.data = data.part(firstRow * rowStride, data.count - firstRow * rowStride);
    return m;
  }

  explicit operator bool() const { return static_cast<bool>(data); }
};

}  // namespace tessera
