// Included by every kernel: pointers, the common argument structs, and functions to read them.
// Defines: FloatPointer, UintPointer, Vec2Pointer, Vec4Pointer, KERNEL_ARGUMENTS(), IS_SET(), FOR_EACH(),
// FOR_EACH_ROW(), rowRangeBegin(), rowRangeEnd(), columnOffset(), elementIndex().
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_control_flow_attributes : require

layout(buffer_reference, std430, buffer_reference_align = 4) buffer UintPointer { uint values[]; };
#ifdef TESSERA_WORDS  // for kernels that only move numbers: floats are moved as words
#define FloatPointer UintPointer
#else
layout(buffer_reference, std430, buffer_reference_align = 4) buffer FloatPointer { float values[]; };
#endif
// The same floats, loaded as vectors.
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

// Whether an optional pointer of any type is not null.
#define IS_SET(pointer) any(notEqual(uvec2(pointer), uvec2(0)))

// Loops over every index below `count`, distributed over all invocations along x.
#define FOR_EACH(index, count)                                     \
  for (uint index = gl_GlobalInvocationID.x; index < (count);      \
       index += gl_NumWorkGroups.x * gl_WorkGroupSize.x)

// An operation works on the rows [rowRangeBegin, rowRangeEnd).
uint rowRangeEnd(CountArguments count) { return min(count.counter.values[0], count.capacity); }
uint rowRangeBegin(CountArguments count) { return count.first.values[0]; }

// Loops over every row of a count, distributed over all invocations along x.
#define FOR_EACH_ROW(row, count)                                                                     \
  for (uint row = rowRangeBegin(count) + gl_GlobalInvocationID.x, row##End = rowRangeEnd(count); row < row##End; \
       row += gl_NumWorkGroups.x * gl_WorkGroupSize.x)

// Return the index of an element of a matrix in either layout; columnOffset is the column's part, for loops over rows.
uint columnOffset(MatrixArguments m, uint column) {
  if (m.groupWidth == 0) return column;
  return column / m.groupWidth * m.groupStride + column % m.groupWidth;
}
uint elementIndex(MatrixArguments m, uint row, uint column) { return columnOffset(m, column) + row * m.rowStride; }
