// The texels of patches, decoded from blocks in memory.
// Reads: MeshPartArguments. Defines: PatchPlace, placeInPatch(), mixOpacity(), mixFeatures().

// The four texels around a place of a patch.
struct PatchPlace {
  uvec2 texels[4];  // number of the block of 4×4 texels, and of the texel in it
  float weights[4];
};

PatchPlace placeInPatch(MeshPartPointer part, uint patchNumber, vec2 place) {
  const uint edge = part.value.patchEdge, across = part.value.patchesAcross;
  const vec2 at = place * float(edge - 1);
  const uvec2 cell = min(uvec2(at), uvec2(edge - 2));
  const vec2 between = clamp(at - vec2(cell), 0, 1);
  const uvec2 first = edge * uvec2(patchNumber % across, patchNumber / across) + cell;
  PatchPlace around;
  for (uint corner = 0; corner < 4; ++corner) {
    const uvec2 next = uvec2(corner & 1, corner >> 1), texel = first + next;
    around.texels[corner] = uvec2(texel.x / 4 + across * edge / 4 * (texel.y / 4), texel.x % 4 + 4 * (texel.y % 4));
    const vec2 weights = mix(1 - between, between, vec2(next));
    around.weights[corner] = weights.x * weights.y;
  }
  return around;
}

// Returns a texel of a BC4 block, 0 to 255 without rounding (src/tiles/bc4.h).
float bc4Texel(uint first, uint second, uint texel) {
  const float e0 = first & 0xff, e1 = first >> 8 & 0xff;
  const uint bit = 16 + 3 * texel;
  const uint index = 7 & (bit >= 32 ? second >> (bit - 32) : bit < 30 ? first >> bit : first >> bit | second << (32 - bit));
  if (index < 2) return index == 0 ? e0 : e1;
  if (e0 > e1) return (float(8 - index) * e0 + float(index - 1) * e1) / 7;
  if (index >= 6) return index == 6 ? 0 : 255;
  return (float(6 - index) * e0 + float(index - 1) * e1) / 5;
}

float mixOpacity(MeshPartPointer part, PatchPlace around) {
  UintPointer blocks = part.value.opacities;
  float sum = 0;
  for (uint corner = 0; corner < 4; ++corner) {
    const uint at = 2 * around.texels[corner].x;
    sum += around.weights[corner] * bc4Texel(blocks.values[at], blocks.values[at + 1], around.texels[corner].y);
  }
  return sum / 255;
}

// Returns the features 2·texture and 2·texture + 1.
vec2 mixFeatures(MeshPartPointer part, PatchPlace around, uint texture) {
  UintPointer blocks = part.value.features[texture];
  vec2 sum = vec2(0);
  for (uint corner = 0; corner < 4; ++corner) {
    const uint at = 4 * around.texels[corner].x, texel = around.texels[corner].y;
    sum += around.weights[corner] * vec2(bc4Texel(blocks.values[at], blocks.values[at + 1], texel),
                                         bc4Texel(blocks.values[at + 2], blocks.values[at + 3], texel));
  }
  return vec2(part.value.low[2 * texture], part.value.low[2 * texture + 1]) +
         vec2(part.value.span[2 * texture], part.value.span[2 * texture + 1]) * (sum / 255);
}
