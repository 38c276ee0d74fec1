// The arguments of the compute kernels, declared once for C++ and GLSL. Each kind of operation has its own file; this
// one contains the common parts. Pointers are aligned to 8 bytes and the sizes of structs are multiples of 8, so that
// std430 and C++ have the same layout.
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_H

#ifdef __cplusplus
#include <cstdint>
#define TESSERA_BEGIN_ARGUMENTS namespace tessera::arguments {
#define TESSERA_END_ARGUMENTS }  // namespace tessera::arguments
#define TESSERA_SIZE(type, bytes) static_assert(sizeof(type) == bytes)
namespace tessera::arguments {
using uint = uint32_t;
using FloatPointer = uint64_t;   // device addresses; 0 if absent
using UintPointer = uint64_t;
using NumberPointer = uint64_t;  // fp16 or float, depending on the kernel; see number.glsl
using QuadPointer = uint64_t;    // four Numbers each
using SumPointer = uint64_t;     // floats that several invocations add to
using Bits64 = uint64_t;         // the lower half is first
}  // namespace tessera::arguments
#else
#define TESSERA_BEGIN_ARGUMENTS
#define TESSERA_END_ARGUMENTS
#define TESSERA_SIZE(type, bytes)
#define Bits64 uvec2
#endif

TESSERA_BEGIN_ARGUMENTS

struct CountArguments {
  UintPointer counter;  // the number of rows; the largest uint if the operation has no counter
  UintPointer first;    // the first row; 0 if the operation has none
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

// A number that kernels use as a double if the device supports it, otherwise as a float: the bits of either.
struct RealArguments {
  uint low;
  uint high;  // 0 for a float
};
TESSERA_SIZE(RealArguments, 8);

TESSERA_END_ARGUMENTS
#endif
