// Arguments of prefix sums and reductions (scan_*.comp, add_partials.comp).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_SCAN_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_SCAN_H
#include "arguments.h"
#define TESSERA_SCAN_CHUNK 4096  // numbers per workgroup

TESSERA_BEGIN_ARGUMENTS

// values[i] = Σ_{j <= i} counts[j], saturated at limit + 1. `total` is the largest value that is at most `limit`, and
// `fitting` the number of such values.
struct ScanArguments {
  CountArguments rows;
  UintPointer counts;    // [capacity]; may be `values`
  UintPointer values;    // [capacity]
  UintPointer partials;  // one per workgroup
  UintPointer total;     // [1]
  UintPointer fitting;   // [1]
  uint partialCount;
  uint limit;            // below 2^31
};
TESSERA_SIZE(ScanArguments, 72);

// sums[c] = Σ partials[i][c]
struct AddPartialsArguments {
  FloatPointer partials;  // [count][columns]
  FloatPointer sums;
  uint count;
  uint columns;
};
TESSERA_SIZE(AddPartialsArguments, 24);

TESSERA_END_ARGUMENTS
#endif
