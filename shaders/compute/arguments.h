// What the host hands to each compute kernel: one truth, read by C++ and GLSL alike. Each kind of operation has a file
// of its own; this one holds what they share. Pointers lie at multiples of 8 and so do the sizes of structs: std430 and
// C++ lay them out the same.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_H

#ifdef __cplusplus
#include <cstdint>
#define TESSERA_BEGIN_ARGUMENTS namespace tessera::arguments {
#define TESSERA_END_ARGUMENTS }  // namespace tessera::arguments
#define TESSERA_SIZE(type, bytes) static_assert(sizeof(type) == bytes)
namespace tessera::arguments {
using uint = uint32_t;
using FloatPointer = uint64_t;   // device addresses; 0 = not wanted
using UintPointer = uint64_t;
using NumberPointer = uint64_t;  // fp16 or float, as the kernel is; see number.glsl
using QuadPointer = uint64_t;    // four of them
using SumPointer = uint64_t;     // floats that several invocations add to
using Bits64 = uint64_t;         // the lower half first
}  // namespace tessera::arguments
#else
#define TESSERA_BEGIN_ARGUMENTS
#define TESSERA_END_ARGUMENTS
#define TESSERA_SIZE(type, bytes)
#define Bits64 uvec2
#endif

TESSERA_BEGIN_ARGUMENTS

struct CountArguments {
  UintPointer counter;  // where the operation has none, the largest number
  UintPointer first;    // or 0
  uint capacity;
  uint unused;
};
TESSERA_SIZE(CountArguments, 24);

struct MatrixArguments {
  FloatPointer data;
  uint columns;
  uint rowStride;
  uint groupWidth;  // 0: row-major
  uint groupStride;
};
TESSERA_SIZE(MatrixArguments, 24);

// A number that kernels reckon with in double where the device can, else in float: bits of the one or the other.
struct RealArguments {
  uint low;
  uint high;  // 0: float
};
TESSERA_SIZE(RealArguments, 8);

TESSERA_END_ARGUMENTS
#endif
