// Thresholds that decide whether a half-transparent layer is drawn in a pixel of a frame (stochastic transparency).
// Layers have independent thresholds, so that the mean over frames is the composited image. Of the 2^k frames from a
// multiple of 2^k on (k ≤ 6), a layer passes in as many as its opacity says, within one: the thresholds of 64 frames are
// a van der Corput sequence with Owen's scrambling, anew for each layer and 64 frames.
// Source: Owen 1995, "Randomly Permuted (t,m,s)-Nets and (t,s)-Sequences".
// Defines: ditherThreshold().

uint scatterBits(uint x) {
  x = (x ^ x >> 16) * 0x21f0aaadu;
  x = (x ^ x >> 15) * 0x735a2d97u;
  return x ^ x >> 15;
}

// Returns a threshold between 0 and 1, both excluded: a layer is drawn if its opacity is larger. `layer`: any number
// that layers of the same pixel seldom have in common.
float ditherThreshold(uvec2 pixel, uint frame, uint layer) {
  uint seed = scatterBits(pixel.x ^ scatterBits(pixel.y ^ scatterBits(layer ^ scatterBits(frame >> 6))));
  // Of each node of a binary tree with 64 leaves, whether its halves are swapped.
  uint swaps[2] = uint[2](scatterBits(seed ^ 0x9e3779b9u), scatterBits(seed ^ 0x7f4a7c15u));
  uint node = 1u, place = 0u;  // the root; the place of the leaf from left to right
  for (uint i = 0u; i < 6u; ++i) {
    uint digit = frame >> i & 1u;
    place = place << 1 | digit ^ swaps[node >> 5] >> (node & 31u) & 1u;
    node = node << 1 | digit;
  }
  return (float(place) + (float(scatterBits(seed ^ frame) >> 9) + 0.5) / 8388608.0) / 64.0;
}
