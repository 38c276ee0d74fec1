// What every kernel starts with: pointers, the shared argument structs, and how to read them.
// Defines: FloatPointer, UintPointer, Vec2Pointer, Vec4Pointer, KERNEL_ARGUMENTS(), WANTED(), FOR_EACH(), FOR_EACH_ROW(), firstOf(), endOf(),
// columnOffset(), elementOf().
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require

layout(buffer_reference, std430, buffer_reference_align = 4) buffer UintPointer { uint values[]; };
#ifdef TESSERA_WORDS  // of kernels that only move numbers: words of any kind travel this way
#define FloatPointer UintPointer
#else
layout(buffer_reference, std430, buffer_reference_align = 4) buffer FloatPointer { float values[]; };
#endif
// The same floats, several with one load.
layout(buffer_reference, std430, buffer_reference_align = 8) buffer Vec2Pointer { vec2 values[]; };
layout(buffer_reference, std430, buffer_reference_align = 16) buffer Vec4Pointer { vec4 values[]; };
#ifndef TESSERA_SUM_POINTER
#define SumPointer FloatPointer
#endif

#include "arguments.h"

// KERNEL_ARGUMENTS(T): the one push constant; `arguments.values` is the T.
#define KERNEL_ARGUMENTS(type)                                                                            \
  layout(buffer_reference, std430, buffer_reference_align = 16) buffer ArgumentsPointer { type values; }; \
  layout(push_constant, std430) uniform Push { ArgumentsPointer arguments; };

// Whether an optional pointer of any type was given.
#define WANTED(pointer) any(notEqual(uvec2(pointer), uvec2(0)))

// Every index below `count`, shared out among all invocations along x.
#define FOR_EACH(index, count)                                     \
  for (uint index = gl_GlobalInvocationID.x; index < (count);      \
       index += gl_NumWorkGroups.x * gl_WorkGroupSize.x)

// Rows [firstOf, endOf) are what an operation works on.
uint endOf(CountArguments count) { return min(count.counter.values[0], count.capacity); }
uint firstOf(CountArguments count) { return count.first.values[0]; }

// Every row of a count, shared out likewise.
#define FOR_EACH_ROW(row, count)                                                                     \
  for (uint row = firstOf(count) + gl_GlobalInvocationID.x, row##End = endOf(count); row < row##End; \
       row += gl_NumWorkGroups.x * gl_WorkGroupSize.x)

// The index of an element of a matrix, in either layout. Loops over rows have the column's part once.
uint columnOffset(MatrixArguments m, uint column) {
  if (m.groupWidth == 0) return column;
  return column / m.groupWidth * m.groupStride + column % m.groupWidth;
}
uint elementOf(MatrixArguments m, uint row, uint column) { return columnOffset(m, column) + row * m.rowStride; }
