// The cells and table entries of the hash grid, for kernels with a constant number of features.
// Reads: LevelArguments, kFeatures. Defines: what hash_grid_cells.glsl defines, kQuads, entryQuad().

#include "hash_grid_cells.glsl"

// Returns four features of an entry, padded with zeros: `entry` is an index of vectors (Vec2Pointer(table), ...).
const uint kQuads = (kFeatures + 3) / 4;
vec4 entryQuad(FloatPointer table, uint entry, uint quad) {
  if (kFeatures == 1) return vec4(table.values[entry], 0, 0, 0);
  if (kFeatures == 2) return vec4(Vec2Pointer(table).values[entry], 0, 0);
  return Vec4Pointer(table).values[entry * kQuads + quad];
}
