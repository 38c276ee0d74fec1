// Decodes mesh contents from arbitrary bytes. Memory stays bounded, and every accepted content satisfies the rules and
// survives a round trip.
#include "representations/mesh/content/mesh_payload.h"
#include "tiles/testing/content_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  fuzzContent(
      data, size, decodedMeshBytes, decodeMesh, [](const MeshContent& content) { return encodeMesh(content); },
      [](const PatchSet& a, const PatchSet& b) {
        return a.origin == b.origin && a.step == b.step && a.ranges == b.ranges && a.decoder == b.decoder &&
               a.pairs == b.pairs && a.vertices == b.vertices && a.featureBlocks == b.featureBlocks &&
               a.opacityBlocks == b.opacityBlocks;
      });
  return 0;
}
