#include "representations/mesh/content/mesh_payload.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/random.h"
#include "representations/mesh/testing/random_mesh.h"
#include "tiles/glb.h"
#include "tiles/read_content.h"

namespace tessera {
namespace {

using nlohmann::json;
using tiles_test::inferredMeshContent;
using tiles_test::randomMeshContent;
using tiles_test::randomMeshNetwork;

void expectSameMesh(const MeshContent& a, const MeshContent& b) {
  EXPECT_EQ(a.isBackground, b.isBackground);
  EXPECT_EQ(a.skyEdge, b.skyEdge);
  EXPECT_EQ(a.sky, b.sky);
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (size_t i = 0; i < a.parts.size(); ++i) {
    const PatchSet &one = a.parts[i], &other = b.parts[i];
    EXPECT_EQ(one.patchEdge, other.patchEdge);
    EXPECT_EQ(one.patches, other.patches);
    EXPECT_EQ(one.pairs, other.pairs);
    EXPECT_EQ(one.origin, other.origin);
    EXPECT_EQ(one.step, other.step);
    EXPECT_EQ(one.vertices, other.vertices);
    EXPECT_EQ(one.ranges, other.ranges);
    EXPECT_EQ(one.featureBlocks, other.featureBlocks);
    EXPECT_EQ(one.opacityBlocks, other.opacityBlocks);
    EXPECT_TRUE(one.decoder == other.decoder);
    EXPECT_TRUE(one.encoder == other.encoder);
  }
}

void expectRoundTrip(const MeshContent& content) {
  std::string reason;
  const Resources resources(content.encoders.begin(), content.encoders.end());
  const auto again = decodeMesh(encodeMesh(content), reason, {}, resources);
  ASSERT_TRUE(again) << reason;
  EXPECT_EQ(again->encoders, content.encoders);
  EXPECT_EQ(reason, "");
  expectSameMesh(content, *again);
}

PatchSet emptyPatchSet() {
  PatchSet set;
  set.decoder = randomMeshNetwork(1);
  return set;
}

json parsePayloadAsset(const Bytes& file) {
  return json::parse(decodeGlb(file)->json)["extensions"]["TESSERA_content"];
}

TEST(MeshPayload, GivesBackWhatWasWritten) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    const MeshContent content = randomMeshContent(seed, static_cast<uint32_t>(1 + seed % 3));
    EXPECT_FALSE(parsePayloadAsset(encodeMesh(content)).contains("sky"));
    expectRoundTrip(content);
  }
}

TEST(MeshPayload, GivesBackABackgroundBlockWithItsSky) {
  MeshContent content = randomMeshContent(3, 1, true);
  ASSERT_EQ(content.skyEdge, 4u);
  expectRoundTrip(content);
  content.skyEdge = 0;
  content.sky.clear();
  expectRoundTrip(content);
}

TEST(MeshPayload, GivesBackAPartWithoutPatches) {
  MeshContent content = randomMeshContent(4, 1);
  content.parts.insert(content.parts.begin(), emptyPatchSet());
  expectRoundTrip(content);
  const json part = parsePayloadAsset(encodeMesh(content))["parts"][0];
  for (const char* key : {"vertices", "features", "opacity"}) EXPECT_FALSE(part.contains(key)) << key;
}

TEST(MeshPayload, GivesBackAnEncoderInsteadOfTextures) {
  MeshContent content = inferredMeshContent(4);
  expectRoundTrip(content);
  for (const char* key : {"features", "opacity"})
    EXPECT_FALSE(parsePayloadAsset(encodeMesh(content))["parts"][1].contains(key)) << key;
  EXPECT_EQ(patchSetBytes(content.parts[1]), patchSetBytes(tiles_test::randomPatchSet(5))) << "the textures count";
  content.encoders.push_back(content.encoders[0]);
  content.parts[1].encoder->resource = 1;
  expectRoundTrip(content);
  // Textures that have been inferred are not written.
  const Bytes file = encodeMesh(content);
  const PatchSet stored = tiles_test::randomPatchSet(5);
  content.parts[1].featureBlocks = stored.featureBlocks;
  content.parts[1].opacityBlocks = stored.opacityBlocks;
  EXPECT_EQ(encodeMesh(content), file);
}

TEST(MeshPayload, GivesBackOddNumbersExactly) {
  MeshContent content = randomMeshContent(5, 1);
  PatchSet& part = content.parts[0];
  part.origin = {-1e7, -0.1, std::numeric_limits<double>::denorm_min()};
  part.step = 1.0 / 3;
  part.ranges[0] = {-1e6f, 1e6f};
  part.ranges[1] = {-0.1f, -0.1f};
  part.ranges[2] = {-std::numeric_limits<float>::denorm_min(), std::numeric_limits<float>::denorm_min()};
  expectRoundTrip(content);
}

TEST(MeshPayload, HasACodecThatLetsContentsOverlap) {
  EXPECT_EQ(meshCodec().representation(), kMeshName);
  EXPECT_TRUE(meshCodec().contentsMayOverlap());
}

TEST(MeshPayload, ReportsItsMemoryFromHeadersAlone) {
  const fs::path path = fs::temp_directory_path() / ("tessera-mesh-file-" + std::to_string(::getpid()) + ".glb");
  MeshContent empty = randomMeshContent(7, 1);
  empty.parts.push_back(emptyPatchSet());
  for (const MeshContent& content : {randomMeshContent(5, 2), randomMeshContent(6, 1, true), empty}) {
    writeFileAtomically(path, encodeMesh(content));
    EXPECT_EQ(readDecodedBytes(path, meshCodec()), bytesInMemory(content));
    const auto again = readContent(path, meshCodec());
    EXPECT_EQ(again->memoryBytes(), bytesInMemory(content));
    expectSameMesh(contentAs<MeshContent>(*again), content);
  }
  fs::remove(path);
}

TEST(MeshPayload, CountsTheBytesThatItsPartsHold) {
  const MeshContent content = randomMeshContent(3, 2, true);
  uint64_t sum = sizeof(MeshContent) + content.sky.size();
  for (const PatchSet& part : content.parts) {
    uint64_t bytes = sizeof(PatchSet) + 2 * part.vertices.size() + part.opacityBlocks.size();
    for (const auto& blocks : part.featureBlocks) bytes += blocks.size();
    // The outputs of layers count as rounded up to multiples of 8, which no layer but the last one needs.
    const uint32_t padding = 8 - part.decoder.back().outputs;
    bytes += bytesInMemory(part.decoder) + sizeof(float) * padding * (part.decoder.back().inputs + 1);
    EXPECT_EQ(patchSetBytes(part), bytes);
    sum += bytes;
  }
  EXPECT_EQ(bytesInMemory(content), sum);
}

TEST(MeshPayload, HasTexturesThatEveryGpuSupportsUpToItsBounds) {
  for (uint32_t edge = PatchSet::kMinPatchEdge; edge <= PatchSet::kMaxPatchEdge; edge += 4) {
    PatchSet set;
    set.patchEdge = edge;
    for (const uint32_t patches : {1u, 2u, 3u, 4u, 5u, 12u, 13u, 16u, maxPatches(edge)}) {
      set.patches = patches;
      EXPECT_LE(set.textureWidth(), PatchSet::kMaxTextureEdge);
      EXPECT_LE(set.textureHeight(), PatchSet::kMaxTextureEdge);
      const uint32_t across = set.patchesAcross();
      EXPECT_GE(across * across, patches);
      EXPECT_LT((across - 1) * (across - 1), patches);
      EXPECT_GE(across * (set.textureHeight() / edge), patches);
      EXPECT_LT(across * (set.textureHeight() / edge - 1), patches);
    }
  }
}

TEST(MeshPayload, RefusesToWriteMoreThanReadersTake) {
  MeshContent content;
  content.parts.assign(ContentLimits().parts + 1, emptyPatchSet());
  EXPECT_THROW(encodeMesh(content), Error);
  content.parts.pop_back();
  expectRoundTrip(content);
}

TEST(MeshPayload, NamesTheRuleThatIsBroken) {
  const auto names = [](const char* rule, const std::function<void(MeshContent&)>& spoil) {
    MeshContent content = randomMeshContent(2, 2, true);
    ASSERT_EQ(validationError(content), std::nullopt);
    spoil(content);
    EXPECT_EQ(validationError(content).value_or("none"), rule);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  names("the edge of its sky is out of bounds", [](MeshContent& c) { c.skyEdge = 1; });
  names("the edge of its sky is out of bounds", [](MeshContent& c) { c.skyEdge = kMaxSkyEdge + 1; });
  names("it has a sky, but is no background block", [](MeshContent& c) { c.isBackground = false; });
  names("its sky has the wrong size", [](MeshContent& c) { c.sky.pop_back(); });
  names("its sky has the wrong size", [](MeshContent& c) { c.skyEdge = 0; });
  names("there are no parts", [](MeshContent& c) { c.parts.clear(); });
  for (const uint32_t edge : {0u, 2u, 10u, 36u})
    names("part 1: its patch_edge is out of bounds", [&](MeshContent& c) { c.parts[1].patchEdge = edge; });
  const char* count = "part 0: its patches or pairs are out of bounds";
  names(count, [](MeshContent& c) { c.parts[0].pairs = c.parts[0].patches + 1; });
  names(count, [](MeshContent& c) { c.parts[0].patches = maxPatches(c.parts[0].patchEdge) + 1; });
  for (const double step : {0.0, -1.0, 1e-13, 1e6, double{nan}, double{INFINITY}})
    names("part 0: its step is out of bounds", [&](MeshContent& c) { c.parts[0].step = step; });
  for (const double place : {1.1e7, -1.1e7, double{nan}, double{INFINITY}})
    names("part 1: its origin is out of bounds", [&](MeshContent& c) { c.parts[1].origin[2] = place; });
  const char* range = "part 0: a range is out of bounds";
  names(range, [&](MeshContent& c) { c.parts[0].ranges[7].high = nan; });
  names(range, [&](MeshContent& c) { c.parts[0].ranges[7].low = nan; });
  names(range, [](MeshContent& c) { c.parts[0].ranges[0] = {1, 0}; });
  names(range, [](MeshContent& c) { c.parts[0].ranges[0] = {0, 2e6f}; });
  names(range, [](MeshContent& c) { c.parts[0].ranges[0] = {-2e6f, 0}; });
  names("part 0: it has the wrong number of vertices", [](MeshContent& c) { c.parts[0].vertices.pop_back(); });
  names("part 1: its features have the wrong size", [](MeshContent& c) { c.parts[1].featureBlocks[3].pop_back(); });
  names("part 1: its opacity has the wrong size", [](MeshContent& c) { c.parts[1].opacityBlocks.push_back(0); });
  names("part 0: the network has no layers, or too many", [](MeshContent& c) { c.parts[0].decoder.clear(); });
  names("part 0: the network's layers do not follow one another",
        [](MeshContent& c) { c.parts[0].decoder[0].inputs = 23; });
  names("part 1: the network does not end in a colour", [](MeshContent& c) { c.parts[1].decoder.pop_back(); });
  names("part 1: the network contains a number that is not finite",
        [&](MeshContent& c) { c.parts[1].decoder[1].biases[2] = nan; });
}

TEST(MeshPayload, NamesTheRuleThatAnEncoderBreaks) {
  const auto names = [](const std::string& rule, const std::function<void(PatchSet&)>& spoil) {
    MeshContent content = inferredMeshContent(2);
    ASSERT_EQ(validationError(content), std::nullopt);
    spoil(content.parts[1]);
    EXPECT_EQ(validationError(content).value_or("none"), "part 1: " + rule);
  };
  names("its encoder is not among the resources of the content", [](PatchSet& part) { part.encoder->resource = 1; });
  for (const double number : {1.1e12, -1.1e12, double{NAN}, double{INFINITY}}) {
    names("the scale or offset of its encoder is out of bounds", [&](PatchSet& p) { p.encoder->scale[1] = number; });
    names("the scale or offset of its encoder is out of bounds", [&](PatchSet& p) { p.encoder->offset[2] = number; });
  }
  for (const uint32_t places : {0u, 3u, 8u})
    names("the places of its encoder are out of bounds", [&](PatchSet& part) { part.encoder->places = places; });
  const std::string opacities = "the opacities of its encoder are out of bounds";
  for (const float number : {-0.1f, 0.9f, NAN})
    names(opacities, [&](PatchSet& part) { part.encoder->transparentBelow = number; });
  for (const float number : {0.1f, 1.1f, NAN})
    names(opacities, [&](PatchSet& part) { part.encoder->opaqueFrom = number; });
  names("its opacity has the wrong size", [](PatchSet& part) { part.opacityBlocks.push_back(0); });
  MeshContent content = inferredMeshContent(2);
  content.isBackground = true;
  EXPECT_EQ(validationError(content), "part 1: it has an encoder, but is of a background block");
  content.isBackground = false;
  content.parts[1].patches = content.parts[1].pairs = 0;
  content.parts[1].vertices.clear();
  EXPECT_EQ(validationError(content), "part 1: it has an encoder, but no patches");
}

TEST(MeshPayload, IsNotWhatTheTilesetDeclaresIfItIsElsewhereOrOfAnotherKind) {
  MeshContent content = randomMeshContent(8, 2);
  TileContent declared;
  declared.box = {Vec3d::Constant(INFINITY), Vec3d::Constant(-INFINITY)};
  for (PatchSet& part : content.parts) {
    ASSERT_LT(part.pairs, part.patches);
    // The last patch is single, and its corner 3 lies far beyond the others.
    for (uint16_t& number : part.vertices) number /= 2;
    for (size_t axis = 0; axis < 3; ++axis) part.vertices[part.vertices.size() - 3 + axis] = UINT16_MAX;
    for (uint32_t patch = 0; patch < part.patches; ++patch)
      for (uint32_t corner = 0; corner < (patch < part.pairs ? 4u : 3u); ++corner) {
        declared.box.low = declared.box.low.cwiseMin(part.corner(patch, corner));
        declared.box.high = declared.box.high.cwiseMax(part.corner(patch, corner));
      }
  }
  const auto mismatch = [&] { return mismatchWithTileset(content, declared).value_or("none"); };
  const SceneBox exact = declared.box;
  EXPECT_EQ(mismatch(), "none");
  // The box may be smaller by the tolerance.
  declared.box = {exact.low + Vec3d::Constant(5e-7), exact.high - Vec3d::Constant(5e-7)};
  EXPECT_EQ(mismatch(), "none");
  for (int axis = 0; axis < 3; ++axis) {
    declared.box = exact;
    declared.box.low[axis] += 1e-5;
    EXPECT_NE(mismatch(), "none");
    declared.box = exact;
    declared.box.high[axis] -= 1e-5;
    EXPECT_NE(mismatch(), "none");
  }
  declared.box = exact;
  for (size_t i = 0; i < 3; ++i) content.parts[1].vertices[i] = UINT16_MAX;
  EXPECT_EQ(mismatch(), "part 1 reaches out of the content's box");
  declared.backgroundBlock = true;
  EXPECT_EQ(mismatch(), "it is not a background block");
  content.isBackground = true;
  declared.backgroundBlock = false;
  EXPECT_EQ(mismatch(), "it is a background block");
}

TEST(MeshPayload, MixesFourTexelsOfWholeBlocks) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const MeshContent content = randomMeshContent(10 + seed, 1);
    const PatchSet& set = content.parts[0];
    const RandomStream random(seed, 5);
    const uint32_t edge = set.patchEdge, blocksAcross = set.textureWidth() / 4;
    // Texel (x, y) of a texture whose blocks have `stride` bytes, of which those from `offset` on are decoded.
    const auto texelAt = [&](const std::vector<uint8_t>& blocks, uint32_t stride, uint32_t offset, uint32_t x,
                             uint32_t y) {
      Bc4Block block;
      std::copy_n(blocks.begin() + stride * (x / 4 + blocksAcross * (y / 4)) + offset, block.size(), block.begin());
      return double{decodeBc4(block)[x % 4 + 4 * (y % 4)]} / 255;
    };
    for (uint32_t i = 0; i < 400; ++i) {
      const uint32_t patch = i % set.patches, last = edge - 1;
      // Texels of the corners and of the sides, and places between texels.
      const auto placeAt = [&](uint64_t k) {
        const uint32_t kind = random.below(8 * i + k, 4);
        return kind == 0 ? 0.0f : kind == 1 ? static_cast<float>(last) : random.uniform(8 * i + k + 2) * last;
      };
      const float column = placeAt(0), row = placeAt(1);
      const uint32_t x = static_cast<uint32_t>(column), y = static_cast<uint32_t>(row);
      const auto mix = [&](const std::vector<uint8_t>& blocks, uint32_t stride, uint32_t offset) {
        double sum = 0;
        for (uint32_t dy = 0; dy < 2; ++dy)
          for (uint32_t dx = 0; dx < 2; ++dx) {
            if (x + dx > last || y + dy > last) continue;  // has no weight
            const double u = double{column} - x, v = double{row} - y;
            sum += (dx == 1 ? u : 1 - u) * (dy == 1 ? v : 1 - v) *
                   texelAt(blocks, stride, offset, edge * (patch % set.patchesAcross()) + x + dx,
                           edge * (patch / set.patchesAcross()) + y + dy);
          }
        return sum;
      };
      const MeshTexel mixed = mixTexels(set, patch, column, row);
      for (uint32_t f = 0; f < kMeshFeatures; ++f) {
        const double low = set.ranges[f].low, high = set.ranges[f].high;
        EXPECT_NEAR(mixed.features[f], low + (high - low) * mix(set.featureBlocks[f / 2], 16, 8 * (f % 2)), 1e-5);
      }
      EXPECT_NEAR(mixed.opacity, mix(set.opacityBlocks, 8, 0), 1e-6);
    }
  }
}

TEST(MeshPayload, HasASkyWhoseSidesAreAsTheFormatSays) {
  MeshContent content = randomMeshContent(9, 1, true);
  content.skyEdge = 3;  // so that the axes are at the centres of texels
  content.sky.resize(size_t{18} * 3 * 3);
  for (size_t i = 0; i < content.sky.size(); ++i) content.sky[i] = static_cast<uint8_t>(7 * i);
  const auto texelAt = [&](uint32_t side, uint32_t column, uint32_t row, uint32_t channel) {
    return content.sky[3 * ((3 * side + row) * 3 + column) + channel] / 255.0f;
  };
  const auto expectTexel = [&](const Vec3d& direction, uint32_t side, uint32_t column, uint32_t row) {
    for (const double length : {1.0, 2.5}) {
      const std::array<float, 3> colour = skyColour(content, length * direction);
      for (uint32_t c = 0; c < 3; ++c) EXPECT_NEAR(colour[c], texelAt(side, column, row, c), 1e-6) << side;
    }
  };
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d x = Vec3d::Unit(axis), columns = Vec3d::Unit((axis + 1) % 3), rows = Vec3d::Unit((axis + 2) % 3);
    const uint32_t side = static_cast<uint32_t>(2 * axis);
    expectTexel(x, side, 1, 1);
    expectTexel(-x, side + 1, 1, 1);
    expectTexel(x + 0.9999999 * columns, side, 2, 1);
    expectTexel(-x - 0.9999999 * columns, side + 1, 0, 1);
    expectTexel(x + 0.9999999 * rows, side, 1, 2);
    expectTexel(-x - 0.9999999 * rows, side + 1, 1, 0);
  }
  // The first of equal axes counts.
  expectTexel({1, 1, 1}, 0, 2, 2);
  expectTexel({-1, 1, -1}, 1, 2, 0);
  expectTexel({0, -1, 1}, 3, 2, 1);
  // Column 1 + 1/4 and row 1 + 1/2 of side 5 (-z), whose columns run along x and whose rows run along y.
  const std::array<float, 3> colour = skyColour(content, {0.25, 0.5, -1});
  for (uint32_t c = 0; c < 3; ++c) {
    const float upper = 0.75f * texelAt(5, 1, 1, c) + 0.25f * texelAt(5, 2, 1, c),
                lower = 0.75f * texelAt(5, 1, 2, c) + 0.25f * texelAt(5, 2, 2, c);
    EXPECT_NEAR(colour[c], (upper + lower) / 2, 1e-6);
  }
}

}  // namespace
}  // namespace tessera
