#include "representations/mesh/content/mesh_payload.h"

#include "base/check.h"
#include "base/image.h"
#include "tiles/content_file.h"
#include "tiles/lossless_image.h"
#include "tiles/network_payload.h"
#include "tiles/writer_limits.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kRemedy =
    "bake with a higher --tiles-per-block or fewer --texels, or train with a lower --set mesh_cells";
constexpr int kSkyEffort = 9;

Json writeBytes(ContentFileWriter& file, std::span<const std::byte> bytes) {
  return file.add(bytes, kRawBytes);
}

Json writeSky(ContentFileWriter& file, const MeshContent& content) {
  ImageU8 image(static_cast<int>(content.skyEdge), static_cast<int>(6 * content.skyEdge), 3);
  image.pixels = content.sky;
  return {{"edge", content.skyEdge}, {"texels", file.add(encodeLossless(image, kSkyEffort), kWebP)}};
}

Json writePatchSet(ContentFileWriter& file, const PatchSet& set) {
  Json json = {{"patch_edge", set.patchEdge},
               {"patches", set.patches},
               {"pairs", set.pairs},
               {"origin", set.origin},
               {"step", set.step}};
  json["ranges"] = Json::array();
  for (const FeatureRange& range : set.ranges) json["ranges"].push_back({range.low, range.high});
  json["network"] = writeNetwork(file, set.decoder);
  if (set.patches == 0) return json;
  json["vertices"] = writeBytes(file, std::as_bytes(std::span(set.vertices)));
  if (set.encoder) {
    json["encoder"] = {{"resource", set.encoder->resource},      {"scale", set.encoder->scale},
                       {"offset", set.encoder->offset},          {"places", set.encoder->places},
                       {"opaque_from", set.encoder->opaqueFrom}, {"transparent_below", set.encoder->transparentBelow}};
    return json;
  }
  for (const std::vector<uint8_t>& blocks : set.featureBlocks)
    json["features"].push_back(writeBytes(file, std::as_bytes(std::span(blocks))));
  json["opacity"] = writeBytes(file, std::as_bytes(std::span(set.opacityBlocks)));
  return json;
}

}  // namespace

Bytes encodeMesh(const MeshContent& content, ContentFileWriter file, const GltfScene& fallback) {
  const ContentLimits limits;
  requireContentWithin(limits, content.parts.size(), bytesInMemory(content), kRemedy);
  // Any other violated rule is a bug in this program.
  const auto broken = validationError(content);
  CHECK(broken.value_or("") == "");
  Json ours = {{"background_block", content.isBackground}, {"parts", Json::array()}};
  if (content.skyEdge > 0) ours["sky"] = writeSky(file, content);
  for (const PatchSet& part : content.parts) ours["parts"].push_back(writePatchSet(file, part));
  Bytes bytes = file.finish(kMeshName, ours, fallback);
  requireFileWithin(limits, bytes.size(), kRemedy);
  return bytes;
}

Bytes encodeMesh(const MeshContent& content) {
  return encodeMesh(content, ContentFileWriter(), GltfScene());
}

}  // namespace tessera
