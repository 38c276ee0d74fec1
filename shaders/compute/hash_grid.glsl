// Where a point lies in one level of the hash grid (src/compute/hash_grid.h says the convention).
// Reads: LevelArguments, kFeatures. Defines: Cell, cellOf(), upperSides(), cornerEntry(), kQuads, entryQuad(),
// cornerWeight().

struct Cell {
  uvec3 lattice;  // the lower corner
  vec3 fraction;  // within the cell
};

Cell cellOf(vec3 position, LevelArguments level) {
  const vec3 scaled = position * level.scale + 0.5;
  const vec3 lower = floor(scaled);
  return Cell(uvec3(ivec3(lower)), scaled - lower);
}

// Corner 0..7: bit a says whether it is on the upper side of axis a.
bvec3 upperSides(uint corner) { return bvec3(corner & 1, corner & 2, corner & 4); }

// → the corner's entry in the table of all levels.
uint cornerEntry(Cell cell, uint corner, LevelArguments level) {
  const uvec3 c = cell.lattice + uvec3(upperSides(corner));
  const uint index = level.hashed != 0 ? (c.x ^ (c.y * 2654435761u) ^ (c.z * 805459861u)) & (level.entries - 1)
                                       : c.x + level.resolution * (c.y + level.resolution * c.z);
  // Modulo: one round of the lattice and a little more at most. Whatever the position, it stays within the level.
  return level.firstEntry + min(index < level.entries ? index : index - level.entries, level.entries - 1);
}

// An entry's features in fours, the rest of the last four zero: `entry` is of Vec2Pointer(table) and the like.
const uint kQuads = (kFeatures + 3) / 4;
vec4 entryQuad(FloatPointer table, uint entry, uint quad) {
  if (kFeatures == 1) return vec4(table.values[entry], 0, 0, 0);
  if (kFeatures == 2) return vec4(Vec2Pointer(table).values[entry], 0, 0);
  return Vec4Pointer(table).values[entry * kQuads + quad];
}

float cornerWeight(Cell cell, uint corner) {
  const vec3 w = mix(1.0 - cell.fraction, cell.fraction, upperSides(corner));
  return w.x * w.y * w.z;
}
