#include "compute/rows.h"

#include <cstring>

#include "compute/reference/convert.h"

namespace tessera::reference {

void run(const GatherRows& a) {
  const size_t rows = hostCount(a.rows);
  const Indices source = indices(a.source, rows);
  CHECK(a.input.columns == a.output.columns);
  for (size_t row = 0; row < rows; ++row)
    for (size_t column = 0; column < a.output.columns; ++column)  // copies bits: elements can be of any 32-bit type
      std::memcpy(hostPointer(a.output.data) + a.output.offset(row, column),
                  hostPointer(a.input.data) + a.input.offset(source[row], column), sizeof(float));
}

void run(const ScatterRows& a) {
  const Indices source = indices(a.source, hostCount(a.rows));
  CHECK(a.input.columns == a.output.columns);
  for (size_t row = 0; row < source.size(); ++row)
    for (uint32_t column = 0; column < a.input.columns; ++column) {
      const size_t from = a.input.offset(row, column), to = a.output.offset(source[row], column);
      CHECK(from < a.input.data.count);
      CHECK(to < a.output.data.count);
      // Copies words, because the elements can be of any 32-bit type.
      std::memcpy(hostPointer(a.output.data) + to, hostPointer(a.input.data) + from, sizeof(float));
    }
}

void run(const AddColumns& a) {
  const size_t rows = hostCount(a.rows);
  Doubles sums = doubles(Matrix<const float>(a.output), rows);
  const Doubles added = doubles(a.input, rows);
  CHECK(a.input.columns == a.output.columns);
  for (size_t i = 0; i < sums.size(); ++i) sums[i] += added[i];
  store(a.output, sums);
}

}  // namespace tessera::reference
