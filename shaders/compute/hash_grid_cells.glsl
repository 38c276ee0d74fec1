// The cell of a point in one level of the hash grid; src/compute/hash_grid.h defines the convention.
// Reads: LevelArguments. Defines: Cell, findCell(), upperSides(), cornerEntry(), cornerWeight().

struct Cell {
  uvec3 lattice;  // the lower corner
  vec3 fraction;  // within the cell
};

Cell findCell(vec3 position, LevelArguments level) {
  const vec3 scaled = position * level.scale + 0.5;
  const vec3 lower = floor(scaled);
  return Cell(uvec3(ivec3(lower)), scaled - lower);
}

// Bit a of a corner 0..7 tells whether it is on the upper side of axis a.
bvec3 upperSides(uint corner) { return bvec3(corner & 1, corner & 2, corner & 4); }

// Returns the corner's entry in the table of all levels.
uint cornerEntry(Cell cell, uint corner, LevelArguments level) {
  const uvec3 c = cell.lattice + uvec3(upperSides(corner));
  const uint index = level.hashed != 0 ? (c.x ^ (c.y * 2654435761u) ^ (c.z * 805459861u)) & (level.entries - 1)
                                       : c.x + level.resolution * (c.y + level.resolution * c.z);
  // Modulo: the index exceeds the number of entries at most slightly. The clamp keeps it within the level for any
  // position.
  return level.firstEntry + min(index < level.entries ? index : index - level.entries, level.entries - 1);
}

float cornerWeight(Cell cell, uint corner) {
  const vec3 w = mix(1.0 - cell.fraction, cell.fraction, upperSides(corner));
  return w.x * w.y * w.z;
}
