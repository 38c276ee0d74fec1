// What the decoder of meshes refuses, and for which reason.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "base/random.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/testing/random_mesh.h"
#include "tiles/glb.h"
#include "tiles/testing/content_refusal.h"

namespace tessera {
namespace {

using nlohmann::json;
using tiles_test::inferredMeshContent;
using tiles_test::randomMeshContent;

class MeshDecoder : public tiles_test::Refusal {
 protected:
  Bytes file() const override { return encodeMesh(randomMeshContent(5, 2, true)); }
  bool isRead(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) const override {
    return decodeMesh(file, reason, limits).has_value();
  }
};

TEST_F(MeshDecoder, RejectsMalformedHeaders) {
  refuses("is not of the representation mesh", [](json& asset) { ours(asset)["representation"] = "another"; });
  refuses("has version 2", [](json& asset) { ours(asset)["version"] = 2; });
  refuses("background_block is missing", [](json& asset) { ours(asset).erase("background_block"); });
  refuses("background_block is missing", [](json& asset) { ours(asset)["background_block"] = 1; });
  const std::string list = "its parts are not a list, or";
  refuses(list, [](json& asset) { ours(asset).erase("parts"); });
  refuses(list, [](json& asset) { ours(asset)["parts"] = json::array(); });
  refuses(list, [](json& asset) { ours(asset)["parts"] = part(asset); });
  ContentLimits limits;
  limits.parts = 1;
  refuses(
      list, [](json&) {}, limits);
}

TEST_F(MeshDecoder, RejectsMalformedSkies) {
  const std::string edge = "the edge of its sky is out of bounds";
  for (const json& lie : {json(0), json(1), json(1025), json(-4), json(4.5), json("4")})
    refuses(edge, [&](json& asset) { ours(asset)["sky"]["edge"] = lie; });
  refuses(edge, [](json& asset) { ours(asset)["sky"].erase("edge"); });
  refuses(edge, [](json& asset) { ours(asset)["sky"] = 4; });
  const std::string sky = "its sky is malformed";
  refuses(sky, [](json& asset) { ours(asset)["sky"]["edge"] = 5; });
  refuses(sky, [](json& asset) { ours(asset)["sky"].erase("texels"); });
  refuses(sky, [](json& asset) { ours(asset)["sky"]["texels"]["mimeType"] = "image/png"; });
  refuses(sky, [](json& asset) { ours(asset)["sky"]["texels"]["bufferView"] = 999; });
  refusesBytes(
      sky, [](json& asset, Bytes& bytes) { replace(asset, bytes, ours(asset)["sky"]["texels"], ImageU8(24, 4, 3)); });
  refuses("it has a sky, but is no background block", [](json& asset) { ours(asset)["background_block"] = false; });
}

TEST_F(MeshDecoder, RejectsMalformedParts) {
  const std::string edge = "part 0: its patch_edge is out of bounds";
  for (const json& lie : {json(0), json(2), json(10), json(36), json(8.5), json("8")})
    refuses(edge, [&](json& asset) { part(asset)["patch_edge"] = lie; });
  refuses(edge, [](json& asset) { part(asset).erase("patch_edge"); });
  refuses(edge, [](json& asset) { part(asset) = 3; });
  const std::string count = "part 0: its patches or pairs are out of bounds";
  for (const json& lie : {json(-1), json(1.5), json(1 << 20), json("3")}) {
    refuses(count, [&](json& asset) { part(asset)["patches"] = lie; });
    refuses(count, [&](json& asset) { part(asset)["pairs"] = lie; });
  }
  refuses(count, [](json& asset) { part(asset).erase("patches"); });
  refuses(count, [](json& asset) { part(asset).erase("pairs"); });
  const std::string place = "part 0: its origin or step is missing or malformed";
  refuses(place, [](json& asset) { part(asset).erase("origin"); });
  refuses(place, [](json& asset) { part(asset)["origin"].erase(2); });
  refuses(place, [](json& asset) { part(asset)["origin"][1] = "0"; });
  refuses(place, [](json& asset) { part(asset).erase("step"); });
  refuses(place, [](json& asset) { part(asset)["step"] = nullptr; });
  refuses("part 0: its origin is out of bounds", [](json& asset) { part(asset)["origin"][1] = 1e9; });
  refuses("part 0: its step is out of bounds", [](json& asset) { part(asset)["step"] = 0; });
  const std::string ranges = "part 0: its ranges are missing or malformed";
  refuses(ranges, [](json& asset) { part(asset).erase("ranges"); });
  refuses(ranges, [](json& asset) { part(asset)["ranges"].erase(7); });
  refuses(ranges, [](json& asset) { part(asset)["ranges"].push_back({0, 1}); });
  refuses(ranges, [](json& asset) { part(asset)["ranges"][3] = {1}; });
  refuses(ranges, [](json& asset) { part(asset)["ranges"][3][0] = "a"; });
  refuses("part 0: a range is out of bounds", [](json& asset) { part(asset)["ranges"][3] = {1, 0}; });
  refuses("part 0: a range is out of bounds", [](json& asset) { part(asset)["ranges"][3] = {0, 1e7}; });
}

TEST_F(MeshDecoder, RejectsMalformedBytesOfParts) {
  const std::string vertices = "part 0: its vertices are malformed", features = "part 0: its features are malformed",
                    opacity = "part 0: its opacity is malformed";
  const auto spoilReference = [&](const std::string& why, const std::function<json&(json&)>& entry) {
    refuses(why, [&](json& asset) { entry(asset) = 3; });
    refuses(why, [&](json& asset) { entry(asset)["bufferView"] = 999; });
    refuses(why, [&](json& asset) { entry(asset)["mimeType"] = "image/webp"; });
    refuses(why, [&](json& asset) {
      json& view = asset["bufferViews"][entry(asset)["bufferView"].get<size_t>()];
      view["byteLength"] = view["byteLength"].get<uint32_t>() - 1;
    });
  };
  spoilReference(vertices, [](json& asset) -> json& { return part(asset)["vertices"]; });
  for (const size_t k : {0u, 3u})
    spoilReference(features, [k](json& asset) -> json& { return part(asset)["features"][k]; });
  spoilReference(opacity, [](json& asset) -> json& { return part(asset)["opacity"]; });
  refuses(vertices, [](json& asset) { part(asset).erase("vertices"); });
  refuses(vertices, [](json& asset) { part(asset)["patches"] = part(asset)["patches"].get<uint32_t>() + 1; });
  refuses(features, [](json& asset) { part(asset).erase("features"); });
  refuses(features, [](json& asset) { part(asset)["features"].erase(3); });
  refuses(features, [](json& asset) { part(asset)["features"].push_back(part(asset)["features"][0]); });
  refuses(features, [](json& asset) { part(asset)["patch_edge"] = part(asset)["patch_edge"] == 8 ? 12 : 8; });
  refuses(opacity, [](json& asset) { part(asset).erase("opacity"); });
  refuses("part 1: its opacity is malformed", [](json& asset) { ours(asset)["parts"][1].erase("opacity"); });
}

TEST_F(MeshDecoder, RejectsViewsOfAPartWithoutPatches) {
  for (const char* view : {"vertices", "features", "opacity", "encoder"}) {
    refuses(std::string("part 0: it has ") + view + ", but no patches", [view](json& asset) {
      json& spoilt = part(asset);
      for (const char* key : {"patches", "pairs"}) spoilt[key] = 0;
      for (const char* key : {"vertices", "features", "opacity"})
        if (std::string_view(key) != view) spoilt.erase(key);
      if (!spoilt.contains(view)) spoilt[view] = json::object();
    });
  }
}

class InferredMeshDecoder : public MeshDecoder {
 protected:
  Bytes file() const override { return encodeMesh(content_); }
  bool isRead(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) const override {
    return decodeMesh(file, reason, limits, {content_.encoders[0]}).has_value();
  }
  static json& encoder(json& asset) { return ours(asset)["parts"][1]["encoder"]; }

  const MeshContent content_ = inferredMeshContent(3);
};

TEST_F(InferredMeshDecoder, RejectsMalformedEncoders) {
  const std::string malformed = "part 1: its encoder is malformed";
  for (const char* key : {"resource", "scale", "offset", "places", "opaque_from", "transparent_below"}) {
    refuses(malformed, [&](json& asset) { encoder(asset).erase(key); });
    refuses(malformed, [&](json& asset) { encoder(asset)[key] = "1"; });
  }
  refuses(malformed, [](json& asset) { encoder(asset) = 3; });
  refuses(malformed, [](json& asset) { encoder(asset)["resource"] = -1; });
  refuses(malformed, [](json& asset) { encoder(asset)["scale"].erase(2); });
  refuses("part 1: its encoder is not among the resources of the content",
          [](json& asset) { encoder(asset)["resource"] = 1; });
  refuses("part 1: the places of its encoder are out of bounds", [](json& asset) { encoder(asset)["places"] = 3; });
  for (const char* key : {"features", "opacity"})
    refuses("part 1: it has both an encoder and stored maps",
            [&](json& asset) { ours(asset)["parts"][1][key] = part(asset)[key]; });
  refuses("part 1: its features are malformed", [](json& asset) { ours(asset)["parts"][1].erase("encoder"); });
  std::string reason;
  EXPECT_FALSE(decodeMesh(file(), reason)) << "without resources";
  EXPECT_EQ(reason, "part 1: its encoder is not among the resources of the content");
}

TEST_F(MeshDecoder, RejectsMalformedNetworks) {
  refuses("has no network", [](json& asset) { part(asset).erase("network"); });
  refuses("has no network", [](json& asset) { part(asset)["network"].erase("layers"); });
  refuses("has no network", [](json& asset) { part(asset)["network"].erase("bufferView"); });
  refuses("a layer of the network has no two sides", [](json& asset) { part(asset)["network"]["layers"][0] = {17}; });
  refuses("a layer of the network is out of bounds", [](json& asset) {
    part(asset)["network"]["layers"][0] = {17, 1000};
  });
  refuses("the network has fewer numbers", [](json& asset) { part(asset)["network"]["layers"][0] = {17, 20}; });
  refuses("the network has more numbers", [](json& asset) { part(asset)["network"]["layers"].erase(1); });
  // As many numbers as before, but layers that do not follow one another.
  refuses("part 0: the network's layers do not follow one another", [](json& asset) {
    part(asset)["network"]["layers"] = {{16, 3}, {17, 16}};
  });
}

TEST_F(MeshDecoder, RejectsContentsAboveTheMemoryLimitBeforeAllocating) {
  ContentLimits limits;
  limits.bytes = bytesInMemory(randomMeshContent(5, 2, true));
  std::string reason;
  EXPECT_TRUE(decodeMesh(file(), reason, limits)) << reason;
  --limits.bytes;
  const std::string why = "takes more than " + std::to_string(limits.bytes) + " bytes of memory";
  refuses(
      why, [](json&) {}, limits);
  EXPECT_FALSE(decodedMeshBytes(decodeGlb(file())->json, reason, limits));
  EXPECT_EQ(reason, why);
  refuses("takes more than 1073741824 bytes of memory", [](json& asset) {
    part(asset)["patch_edge"] = 32;
    part(asset)["patches"] = maxPatches(32);
    const json large = part(asset);
    for (int i = 0; i < 15; ++i) ours(asset)["parts"].push_back(large);
  });
}

TEST_F(MeshDecoder, RejectsAFileThatIsCutAnywhere) {
  const Bytes whole = file();
  std::string reason;
  for (size_t length = 0; length < whole.size(); ++length) {
    ASSERT_FALSE(decodeMesh(std::span(whole).first(length), reason)) << length;
    ASSERT_NE(reason, "");
  }
}

TEST_F(MeshDecoder, SurvivesCorruptedBytes) {
  const Bytes whole = file();
  const RandomStream random(4, 4);
  std::string reason;
  for (uint64_t trial = 0; trial < 400; ++trial) {
    Bytes spoilt = whole;
    spoilt[random.below(2 * trial, static_cast<uint32_t>(whole.size()))] ^=
        std::byte(1 + random.below(2 * trial + 1, 255));
    const bool isAccepted = decodeMesh(spoilt, reason).has_value();
    EXPECT_EQ(isAccepted, reason.empty());
  }
}

}  // namespace
}  // namespace tessera
