// Decodes mesh contents from arbitrary bytes, which may share an encoder. Memory stays bounded, and every accepted
// content satisfies the rules and survives a round trip.
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/testing/random_mesh.h"
#include "tiles/testing/content_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  static const Resources resources = {std::make_shared<SharedEncoder>(tiles_test::randomMeshEncoder(1))};
  const auto decode = [](std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) {
    return decodeMesh(file, reason, limits, resources);
  };
  fuzzContent(
      data, size, decodedMeshBytes, decode, [](const MeshContent& content) { return encodeMesh(content); },
      [](const PatchSet& a, const PatchSet& b) {
        return a.origin == b.origin && a.step == b.step && a.ranges == b.ranges && a.decoder == b.decoder &&
               a.pairs == b.pairs && a.vertices == b.vertices && a.featureBlocks == b.featureBlocks &&
               a.opacityBlocks == b.opacityBlocks && a.encoder == b.encoder;
      });
  return 0;
}
