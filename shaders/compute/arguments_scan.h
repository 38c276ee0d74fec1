// Arguments of running sums and of sums over all (scan_*.comp, add_partials.comp).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_SCAN_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_SCAN_H
#include "arguments.h"
#define TESSERA_SCAN_CHUNK 4096  // numbers of a workgroup

TESSERA_BEGIN_ARGUMENTS

// values[i] = Σ_{j <= i} counts[j], at most limit + 1. total is the largest that is at most `limit`, and fitting how
// many there are of those.
struct ScanArguments {
  CountArguments rows;
  UintPointer counts;    // [capacity]; may be `values`
  UintPointer values;    // [capacity]
  UintPointer partials;  // one a workgroup
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
