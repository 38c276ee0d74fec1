// GatherRows and ScatterRows: one invocation per element.
#version 460
#extension GL_GOOGLE_include_directive : require
#define TESSERA_WORDS
#include "kernel.glsl"
#include "arguments_rays.h"

layout(local_size_x = 256) in;
layout(constant_id = 0) const bool kScatter = false;
KERNEL_ARGUMENTS(MoveRowsArguments)

void main() {
  MoveRowsArguments a = arguments.values;
  const uint columns = a.from.columns;
  FOR_EACH(i, rowRangeEnd(a.rows) * columns) {
    const uint row = i / columns, column = i % columns, other = a.source.values[row];
    const uint to = elementIndex(a.to, kScatter ? other : row, column);
    a.to.data.values[to] = a.from.data.values[elementIndex(a.from, kScatter ? row : other, column)];
  }
}
