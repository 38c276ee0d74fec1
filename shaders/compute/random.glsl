// Counter-based random numbers, bitwise equal to those of src/base/random.h. 64-bit numbers are uvec2(lower, upper
// half), as not every device has 64-bit integers. `key` is RandomStream::key.
// Defines: mix64(), add64(), randomKey(), randomBits(), randomUniform(), randomBelow().

uvec2 multiply64(uvec2 a, uvec2 b) {
  uint high, low;
  umulExtended(a.x, b.x, high, low);
  return uvec2(low, high + a.x * b.y + a.y * b.x);
}

uvec2 add64(uvec2 a, uvec2 b) {
  uint carry;
  const uint low = uaddCarry(a.x, b.x, carry);
  return uvec2(low, a.y + b.y + carry);
}

// Requires 0 < bits < 32.
uvec2 shiftRight64(uvec2 a, uint bits) { return uvec2(a.x >> bits | a.y << 32 - bits, a.y >> bits); }

uvec2 mix64(uvec2 x) {
  x = add64(x, uvec2(0x7f4a7c15u, 0x9e3779b9u));
  x = multiply64(x ^ shiftRight64(x, 30), uvec2(0x1ce4e5b9u, 0xbf58476du));
  x = multiply64(x ^ shiftRight64(x, 27), uvec2(0x133111ebu, 0x94d049bbu));
  return x ^ shiftRight64(x, 31);
}

// Returns RandomStream(seed, stream).key.
uvec2 randomKey(uvec2 seed, uint stream) {
  return mix64(mix64(seed) ^ multiply64(uvec2(stream, 0), uvec2(0xde82ef95u, 0xd1342543u)));
}

// Returns the upper half of RandomStream::bits.
uint randomBits(uvec2 key, uint index) {
  return mix64(key ^ multiply64(uvec2(index, 0), uvec2(0x4f6cdd1du, 0x2545f491u))).y;
}

// Returns a number in [0, 1) with 24 bits.
float randomUniform(uvec2 key, uint index) { return float(randomBits(key, index) >> 8) * 5.9604644775390625e-8; }

// Returns a number in [0, n).
uint randomBelow(uvec2 key, uint index, uint n) {
  uint high, low;
  umulExtended(randomBits(key, index), n, high, low);
  return high;
}
