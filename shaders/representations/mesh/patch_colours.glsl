// The colours of texels and of the sky.
// Reads: MeshViewArguments, kMaxWidth, runNetwork(), mixFeatures(), harmonic(), findCubeMapPlace(). Defines: Harmonics,
// directionHarmonics(), decode(), skyColour().

struct Harmonics {
  float values[9];
};

Harmonics directionHarmonics(vec3 direction) {
  Harmonics harmonics;
  for (uint i = 0; i < 9; ++i) harmonics.values[i] = harmonic(i, direction);
  return harmonics;
}

vec3 decode(MeshPartPointer part, PatchPlace around, Harmonics harmonics) {
  float values[kMaxWidth];
  for (uint texture = 0; texture < 4; ++texture) {
    const vec2 features = mixFeatures(part, around, texture);
    values[2 * texture] = features.x;
    values[2 * texture + 1] = features.y;
  }
  for (uint i = 0; i < 9; ++i) values[TESSERA_MESH_FEATURES + i] = harmonics.values[i];
  runNetwork(LayersPointer(part.value.layers), part.value.layerCount, FloatPointer(part.value.weights), values);
  return 1 / (1 + exp(-vec3(values[0], values[1], values[2])));
}

vec3 skyColour(MeshViewArguments a, vec3 direction) {
  CubeMapPlace place;
  vec3 colour = vec3(0);
  if (!findCubeMapPlace(a.skyEdge, direction, place)) return colour;
  for (uint corner = 0; corner < 4; ++corner) {
    const uint first = 3 * cubeMapTexel(place, a.skyEdge, corner);
    for (uint c = 0; c < 3; ++c) {
      const uint at = first + c, byte = a.sky.values[at / 4] >> 8 * (at % 4) & 0xff;
      colour[c] += cubeMapWeight(place, corner) * (float(byte) / 255);
    }
  }
  return colour;
}
