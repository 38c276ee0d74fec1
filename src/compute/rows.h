// Moves and adds rows of matrices.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// output row i = input row source[i]. The elements can be of any 32-bit type.
struct GatherRows {
  Count rows;
  Slice<const uint32_t> source;
  Matrix<const float> input;
  Matrix<float> output;  // same kind of layout and number of columns as `input`
};
TESSERA_OPERATION(GatherRows);

// output row source[i] = input row i: the inverse of GatherRows where `source` is a permutation.
struct ScatterRows {
  Count rows;
  Slice<const uint32_t> source;
  Matrix<const float> input;
  Matrix<float> output;
};
TESSERA_OPERATION(ScatterRows);

// output += input, element by element.
struct AddColumns {
  Count rows;
  Matrix<const float> input;
  Matrix<float> output;  // same number of columns as `input`
};
TESSERA_OPERATION(AddColumns);

}  // namespace tessera
