// The corners of a sample in the virtual grid; src/compute/virtual_grid.h defines the convention. Loops over corners
// are unrolled, so that the axes of each corner are known at compile time.
// Reads: VirtualGridArguments, UintPointer. Defines: Places, findPlaces(), Corner, cornerAt(), texelRow(),
// texelPosition(), quantised().

// Two texels along one axis and the weight of the upper one.
struct Pair {
  uint low, high;
  float share;
};

// Computes floor(position · resolution - ½) and the fraction. The floor is exact: both parts of the position have at
// most 12 bits, so that their products with a 12-bit resolution are exact floats, and only the last sums round.
Pair pairAt(float position, uint resolution) {
  const float upper = uintBitsToFloat(floatBitsToUint(position) & 0xfffff000u);
  precise const float whole = upper * float(resolution), rest = (position - upper) * float(resolution);
  const float floored = floor(whole);
  precise const float part = whole - floored;
  precise float share = (part - 1.5) + rest;
  int low = int(floored) + 1;
  if (share < 0) {
    share = (part - 0.5) + rest;
    --low;
  }
  if (share < 0) {
    share = (part + 0.5) + rest;
    --low;
  }
  const int last = int(resolution) - 1;
  return Pair(uint(clamp(low, 0, last)), uint(clamp(low + 1, 0, last)), share);
}

struct Places {
  Pair voxel[3], plane[3];
};

Places findPlaces(VirtualGridArguments grid, vec3 position) {
  Places places;
  for (int axis = 0; axis < 3; ++axis) {
    places.voxel[axis] = pairAt(position[axis], grid.voxels);
    if (grid.planes > 0) places.plane[axis] = pairAt(position[axis], grid.planes);
  }
  return places;
}

uint pairTexel(Pair pair, bool upper) { return upper ? pair.high : pair.low; }
float pairWeight(Pair pair, bool upper) { return upper ? pair.share : 1 - pair.share; }

struct Corner {
  uint texel;
  float weight;
};

// Returns corner k: 0..7 are those of the voxels, then come four of each plane.
Corner cornerAt(VirtualGridArguments grid, Places places, uint k) {
  const bool first = (k & 1) != 0, second = (k & 2) != 0, third = (k & 4) != 0;
  if (k < 8) {
    const Pair x = places.voxel[0], y = places.voxel[1], z = places.voxel[2];
    return Corner(pairTexel(x, first) + grid.voxels * (pairTexel(y, second) + grid.voxels * pairTexel(z, third)),
                  pairWeight(x, first) * pairWeight(y, second) * pairWeight(z, third));
  }
  const uint plane = k / 4 - 2;
  const Pair b = places.plane[plane == 0 ? 1 : 0], c = places.plane[plane == 2 ? 1 : 2];
  const uint firstOfPlane = grid.voxels * grid.voxels * grid.voxels + plane * grid.planes * grid.planes;
  return Corner(firstOfPlane + pairTexel(b, first) + grid.planes * pairTexel(c, second),
                pairWeight(b, first) * pairWeight(c, second));
}

// Returns the row of a corner's texel.
uint texelRow(VirtualGridArguments grid, UintPointer marks, UintPointer ranks, uint block, uint row, uint k, uint texel) {
  if (grid.shareTexels == 0) return row * grid.corners + k;
  const uint word = block * grid.words + texel / 32;
  return ranks.values[word] + bitCount(marks.values[word] & ((1u << texel % 32) - 1));
}

vec3 texelPosition(VirtualGridArguments grid, uint texel) {
  const uint v = grid.voxels, p = grid.planes, all = v * v * v;
  if (texel < all) return (vec3(texel % v, texel / v % v, texel / (v * v)) + 0.5) / float(v);
  const uint inPlanes = texel - all, plane = inPlanes / (p * p);
  vec3 position;
  position[plane] = 0.5;
  position[plane == 0 ? 1 : 0] = inPlanes % p + 0.5;
  position[plane == 2 ? 1 : 2] = inPlanes / p % p + 0.5;
  return position / float(p);
}

// Returns floor(255 value + ½) / 255; the floor is exact as in pairAt.
float quantised(float value) {
  const float upper = uintBitsToFloat(floatBitsToUint(value) & 0xffffff00u);
  precise const float whole = upper * 255.0, rest = (value - upper) * 255.0;
  const float floored = floor(whole);
  precise const float part = whole - floored;
  precise const float beyond = (part - 0.5) + rest;
  return (floored + (beyond >= 0 ? 1 : 0)) / 255.0;
}
