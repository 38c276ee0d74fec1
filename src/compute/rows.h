// Rows of matrices moved from place to place and added up.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// output row i = input row source[i]. 32-bit elements of any kind.
struct GatherRows {
  Count rows;
  Slice<const uint32_t> source;
  Matrix<const float> input;
  Matrix<float> output;  // same layout kind and columns
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
  Matrix<float> output;  // as many columns
};
TESSERA_OPERATION(AddColumns);

}  // namespace tessera
