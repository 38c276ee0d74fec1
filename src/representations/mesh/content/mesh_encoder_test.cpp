#include "representations/mesh/content/mesh_encoder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/testing/random_mesh.h"
#include "tiles/testing/content_refusal.h"
#include "tiles/tileset.h"

namespace tessera {
namespace {

using tiles_test::randomMeshEncoder;

TEST(Half, IsTheNearestNumberOfFp16) {
  for (const float number : {0.0f, 1.0f, -2.5f, 65504.0f, 0x1p-24f}) EXPECT_EQ(fromHalf(toHalf(number)), number);
  EXPECT_EQ(fromHalf(toHalf(1 + 0x1p-11f)), 1) << "a tie goes to the even number";
  EXPECT_EQ(fromHalf(toHalf(1 + 0x1.8p-11f)), 1 + 0x1p-10f);
  EXPECT_EQ(fromHalf(toHalf(1e9f)), 65504);
  EXPECT_EQ(fromHalf(toHalf(-1e9f)), -65504);
}

TEST(MeshEncoder, GivesBackWhatWasWritten) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const MeshEncoder encoder = randomMeshEncoder(seed);
    const Bytes file = encodeMeshEncoder(encoder);
    std::string reason;
    const auto again = decodeMeshEncoder(file, reason);
    ASSERT_TRUE(again) << reason;
    EXPECT_EQ(again->grid.finestResolution, encoder.grid.finestResolution);
    EXPECT_EQ(again->opacityOffset, encoder.opacityOffset);
    EXPECT_EQ(again->table, encoder.table);
    EXPECT_EQ(again->weights, encoder.weights);
    EXPECT_EQ(encodeMeshEncoder(*again), file);
  }
}

TEST(MeshEncoder, IsAResourceThatTakesNoMoreMemoryThanStated) {
  const Bytes file = encodeMeshEncoder(randomMeshEncoder(1));
  std::string reason;
  const SharedResource described{"resources/encoder.glb", kEncoderMimeType, file.size()};
  const auto resource = meshCodec().decodeResource(file, described, reason);
  ASSERT_NE(resource, nullptr) << reason;
  EXPECT_LE(resource->memoryBytes(), meshCodec().resourceMemoryBytes(described, file.size()));
  EXPECT_EQ(meshCodec().decodeResource(encodeMesh(tiles_test::randomMeshContent(1)), described, reason), nullptr);
  EXPECT_EQ(reason, "is not an encoder");
  EXPECT_FALSE(decodeMesh(file, reason)) << "nor is an encoder a content";
}

TEST(MeshEncoder, IsNotWrittenIfReadersWouldRefuseItsSize) {
  MeshEncoder encoder = randomMeshEncoder(1);
  encoder.grid = {16, 2, 24, 64, 2048};
  EXPECT_THROW(encodeMeshEncoder(encoder), Error);
}

class EncoderDecoder : public tiles_test::Refusal {
 protected:
  Bytes file() const override { return encodeMeshEncoder(randomMeshEncoder(2)); }
  bool isRead(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) const override {
    return decodeMeshEncoder(file, reason, limits).has_value();
  }
  static json& encoder(json& asset) { return ours(asset)["encoder"]; }
  // Expects that the value of a key that is missing, or one of `lies`, is refused.
  void refusesKey(const char* key, const std::string& why, const std::vector<json>& lies) {
    refuses(why, [&](json& asset) { encoder(asset).erase(key); });
    for (const json& lie : lies) refuses(why, [&](json& asset) { encoder(asset)[key] = lie; });
  }
};

TEST_F(EncoderDecoder, RejectsMalformedSizes) {
  refuses("is not an encoder", [](json& asset) { ours(asset).erase("encoder"); });
  refusesKey("levels", "the levels or features of its hash grid are out of bounds", {0, -1, 65, 2.5, "3"});
  refusesKey("features", "the levels or features of its hash grid are out of bounds", {0, 3, 16});
  refusesKey("log2_table_size", "its log2_table_size is out of bounds", {2, 29});
  const char* resolutions = "the resolutions of its hash grid are out of bounds";
  refusesKey("base_resolution", resolutions, {1, 24, (1 << 20) + 1});
  refusesKey("finest_resolution", resolutions, {3, (1 << 20) + 1});
  refusesKey("width", "the width or hidden_layers of its network are out of bounds", {0, 24, 256});
  refusesKey("hidden_layers", "the width or hidden_layers of its network are out of bounds", {0, 17});
  refusesKey("opacity_offset", "its opacity_offset is out of bounds", {2e6, "0", nullptr});
  refuses("its table is too large", [](json& asset) {
    encoder(asset)["levels"] = 64;
    encoder(asset)["log2_table_size"] = 28;
    encoder(asset)["finest_resolution"] = 4096;
  });
  ContentLimits limits;
  limits.bytes = 2 * randomMeshEncoder(2).table.size() - 1;
  refuses(
      "its table is too large", [](json&) {}, limits);
}

TEST_F(EncoderDecoder, RejectsMalformedNumbers) {
  for (const char* key : {"table", "weights"}) {
    const std::string why = std::string("its ") + key + (key[0] == 't' ? " is missing or has" : " are missing or have");
    refusesKey(key, why, {3, {{"bufferView", 9}, {"mimeType", "application/octet-stream"}}});
    for (const int by : {-1, -2}) {
      refuses(why, [&](json& asset) {
        json& view = asset["bufferViews"][encoder(asset)[key]["bufferView"].get<size_t>()];
        view["byteLength"] = view["byteLength"].get<int>() + by;
      });
    }
    for (const uint8_t high : {0x7c, 0x7e, 0xfc}) {  // infinities, and what is not a number
      refusesBytes("it contains a number that is not finite", [&](json& asset, Bytes& bytes) {
        const json& view = asset["bufferViews"][encoder(asset)[key]["bufferView"].get<size_t>()];
        bytes[view["byteOffset"].get<size_t>() + 5] = std::byte(high);
      });
    }
  }
  refuses("its table is missing or has the wrong size", [](json& asset) { encoder(asset)["log2_table_size"] = 8; });
  refuses("its weights are missing or have the wrong size", [](json& asset) { encoder(asset)["width"] = 32; });
}

TEST_F(EncoderDecoder, RejectsAFileThatIsCutAnywhere) {
  const Bytes all = file();
  std::string reason;
  for (size_t length = 0; length < all.size(); length += 7)
    ASSERT_FALSE(decodeMeshEncoder(std::span(all).first(length), reason)) << length;
}

}  // namespace
}  // namespace tessera
