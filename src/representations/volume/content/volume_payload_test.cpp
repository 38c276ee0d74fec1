#include "representations/volume/content/volume_payload.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/random.h"
#include "raymarch/content/texel_pictures.h"
#include "raymarch/testing/content_refusal.h"
#include "representations/volume/testing/random_content.h"
#include "tiles/content_file.h"
#include "tiles/glb.h"
#include "tiles/lossless_image.h"
#include "tiles/read_content.h"

namespace tessera {
namespace {

using nlohmann::json;
using tiles_test::testContent;
using tiles_test::testPart;

void expectSame(const VolumeContent& a, const VolumeContent& b) {
  EXPECT_EQ(a.featureRange, b.featureRange);
  EXPECT_EQ(a.densityRange, b.densityRange);
  EXPECT_EQ(a.stepsPerTexel, b.stepsPerTexel);
  EXPECT_TRUE(a.network == b.network);
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (size_t i = 0; i < a.parts.size(); ++i) {
    const VolumePart &one = a.parts[i], &other = b.parts[i];
    tiles_test::expectSamePlace(one, other);
    EXPECT_EQ(one.voxels, other.voxels);
    EXPECT_EQ(one.planes, other.planes);
    EXPECT_EQ(one.voxelBytes, other.voxelBytes);
    EXPECT_EQ(one.planeBytes, other.planeBytes);
    EXPECT_EQ(one.distances, other.distances);
  }
}

std::optional<VolumeContent> roundTrip(const VolumeContent& content) {
  std::string reason;
  auto again = decodeVolume(encodeVolume(content, 1), reason);
  EXPECT_TRUE(again) << reason;
  return again;
}

TEST(VolumePayload, GivesBackWhatWasWritten) {
  for (uint64_t seed = 0; seed < 6; ++seed) {
    VolumeContent content = testContent(seed, 1 + seed % 3);
    content.densityRange = 10.1f;
    const auto again = roundTrip(content);
    ASSERT_TRUE(again);
    expectSame(content, *again);
  }
}

TEST(VolumePayload, GivesBackBackgroundBlocksAndExtremeNumbers) {
  VolumeContent content = testContent(7);
  VolumePart& part = content.parts[0];
  part.contracted = part.backgroundBlock = true;
  part.centre = {0.1f, 1e-30f, -3};
  part.scale = {3, 2, 1};
  part.low = {-1e6f, -1e6f, -1e6f};
  part.high = {1e6f, 1e6f, 1e6f};
  content.network[0].weights[3] = -0.0f;
  content.network[2].biases[1] = std::numeric_limits<float>::denorm_min();
  const auto again = roundTrip(content);
  ASSERT_TRUE(again);
  expectSame(content, *again);
}

TEST(VolumePayload, GivesBackAPartWithoutMacroblocksAndOneWithAll) {
  for (const bool empty : {true, false}) {
    VolumeContent content = testContent(8);
    VolumePart& part = content.parts[0];
    if (empty) {
      part.macroblocks.assign(8, VolumePart::kEmpty);
      part.voxelBytes.clear();
    } else {
      for (uint32_t i = 0; i < 8; ++i) part.macroblocks[i] = i;
      part.voxelBytes.resize(8 * VolumePart::kMacroblockBytes, 77);
    }
    const auto again = roundTrip(content);
    ASSERT_TRUE(again);
    expectSame(content, *again);
  }
}

TEST(VolumePayload, RenumbersMacroblocksInTheOrderOfTheirPlaces) {
  const VolumeContent content = testContent(9);
  VolumeContent shuffled = content;
  VolumePart& part = shuffled.parts[0];
  const uint32_t stored = part.storedMacroblocks();
  ASSERT_GE(stored, 2u);
  for (uint32_t& number : part.macroblocks) {
    if (number != VolumePart::kEmpty) number = stored - 1 - number;
  }
  for (uint32_t i = 0; i < stored; ++i) {
    std::memcpy(part.voxelBytes.data() + i * VolumePart::kMacroblockBytes,
                content.parts[0].voxelBytes.data() + (stored - 1 - i) * VolumePart::kMacroblockBytes,
                VolumePart::kMacroblockBytes);
  }
  const auto again = roundTrip(shuffled);
  ASSERT_TRUE(again);
  expectSame(content, *again);
}

TEST(VolumePayload, EncodesTheSameContentToTheSameBytes) {
  EXPECT_EQ(encodeVolume(testContent(3)), encodeVolume(testContent(3)));
}

TEST(VolumePayload, IsAGltfAssetWithAnEmptySceneForOtherPrograms) {
  const Bytes file = encodeVolume(testContent(1));
  const json asset = json::parse(decodeGlb(file)->json);
  EXPECT_EQ(asset["asset"]["version"], "2.0");
  EXPECT_EQ(asset["extensionsUsed"], json::array({"TESSERA_content"}));
  EXPECT_FALSE(asset.contains("extensionsRequired"));
  EXPECT_EQ(asset["scenes"], json::array({json::object()}));
  for (const json& view : asset["bufferViews"]) EXPECT_EQ(view["byteOffset"].get<size_t>() % 4, 0u);
}

TEST(VolumePayload, PutsAttributesAndSlicesWhereTheFormatSays) {
  const VolumePart part = testPart(5);
  const auto pictures = picturesOfMacroblocks(part.voxelBytes, part.storedMacroblocks());
  // Five to nine macroblocks: three in a row. Block 4, slice 5, row 7, column 2: tile (1, 1), slice (2, 1).
  ASSERT_EQ(sizeOfMacroblocks(5).width, 81u);
  ASSERT_EQ(sizeOfMacroblocks(5).height, 54u);
  ASSERT_GE(part.storedMacroblocks(), 5u);
  ASSERT_LE(part.storedMacroblocks(), 9u);
  const uint8_t* texel = part.voxelBytes.data() + (((4 * 9 + 5) * 9 + 7) * 9 + 2) * 8;
  const int x = 1 * 27 + 2 * 9 + 2, y = 1 * 27 + 1 * 9 + 7;
  EXPECT_EQ(pictures[0].at(x, y)[0], texel[1]);
  EXPECT_EQ(pictures[0].at(x, y)[2], texel[3]);
  EXPECT_EQ(pictures[1].at(x, y)[1], texel[5]);
  EXPECT_EQ(pictures[2].at(x, y)[0], texel[0]);
  EXPECT_EQ(pictures[2].at(x, y)[1], texel[7]);
  EXPECT_EQ(pictures[2].at(x, y)[2], 0);
  const auto plane = picturesOfTexels(part.planeBytes[1], {part.planes, part.planes});
  EXPECT_EQ(plane[0].at(5, 20)[1], part.planeBytes[1][(20 * 24 + 5) * 8 + 2]);
}

TEST(VolumePayload, PacksBitsIntoPicturesThatWebPCanHold) {
  EXPECT_EQ(sizeOfBits(8).width, 256u);
  EXPECT_EQ(sizeOfBits(8).height, 1u);
  EXPECT_EQ(sizeOfBits(8 * 256 + 1).height, 2u);
  const uint64_t cells = kMaxPlanes / VolumePart::kDistanceCell;
  const PictureSize largest = sizeOfBits(cells * cells * cells);
  EXPECT_LE(largest.width, static_cast<uint32_t>(kLargestLosslessSide));
  EXPECT_LE(largest.height, static_cast<uint32_t>(kLargestLosslessSide));
  EXPECT_GE(uint64_t{largest.width} * largest.height * 8, cells * cells * cells);
  EXPECT_LE(sizeOfMacroblocks(kMaxStored).width, static_cast<uint32_t>(kLargestLosslessSide));
}

TEST(VolumePayload, NamesTheSettingsThatMadeMoreThanReadersTake) {
  const auto refuses = [](const std::string& why, const VolumeContent& content) {
    try {
      encodeVolume(content);
      FAIL() << why;
    } catch (const Error& error) {
      EXPECT_NE(error.reason().find(why), std::string::npos) << error.what();
      EXPECT_NE(error.remedy().find("--set"), std::string::npos) << error.what();
    }
  };
  VolumeContent content = testContent(2, 3);
  for (VolumePart& part : content.parts) part.planes = 4096;  // texels are counted before they are checked
  refuses("readers take 1073741824 at most", content);
  content = testContent(2);
  content.parts.resize(1025);
  refuses("merges 1025 blocks", content);
}

class VolumeFile : public testing::Test {
 protected:
  ~VolumeFile() override { fs::remove(path_); }

  // Returns why the file is rejected by its headers, or "" if it is not.
  std::string refusal(std::span<const std::byte> bytes) {
    writeFileAtomically(path_, bytes);
    try {
      readDecodedBytes(path_, volumeCodec());
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), path_.string());
      return error.reason();
    }
    return "";
  }

  const fs::path path_ = fs::temp_directory_path() / ("tessera-volume-file-" + std::to_string(::getpid()) + ".glb");
};

TEST_F(VolumeFile, ReportsItsMemoryWithoutReadingATexel) {
  const VolumeContent content = testContent(5, 2);
  Bytes file = encodeVolume(content, 1);
  writeFileAtomically(path_, file);
  EXPECT_EQ(readDecodedBytes(path_, volumeCodec()), bytesInMemory(content));
  EXPECT_EQ(readContent(path_, volumeCodec())->memoryBytes(), bytesInMemory(content));
  std::fill(file.begin() + static_cast<ptrdiff_t>(kGlbStart + *readJsonLength(file, file.size())), file.end(),
            std::byte{0});
  writeFileAtomically(path_, file);
  EXPECT_EQ(readDecodedBytes(path_, volumeCodec()), bytesInMemory(content));
  EXPECT_THROW(readContent(path_, volumeCodec()), Error);
}

TEST_F(VolumeFile, IsRejectedForMalformedHeaders) {
  const Bytes file = encodeVolume(testContent(5), 1);
  EXPECT_EQ(refusal(file), "");
  EXPECT_EQ(refusal({}), kNoGlb);
  EXPECT_EQ(refusal(std::span(file).first(12)), kNoGlb);
  EXPECT_EQ(refusal(std::span(file).first(file.size() / 8 * 4)), kNoGlb);
  EXPECT_EQ(refusal(encodeGlb(std::string((size_t{8} << 20) + 1, ' '), {})),
            "its JSON is larger than any content's should be");
  EXPECT_EQ(refusal(encodeGlb("{}", {})), "its JSON is not that of a glTF 2.0 asset");
  json asset = json::parse(decodeGlb(file)->json);
  asset["extensions"]["TESSERA_content"]["parts"][0]["planes"] = 4104;
  EXPECT_EQ(refusal(encodeGlb(asset.dump(), {})), "part 0: its header is not complete");
  asset["extensions"]["TESSERA_content"]["network"]["layers"][0] = {34};
  EXPECT_EQ(refusal(encodeGlb(asset.dump(), {})), "a layer of the network has no two sides");
}

TEST(VolumePayload, CountsTheTexelsThatItsPartsHold) {
  const VolumeContent content = testContent(3, 2);
  VolumeContent without = content;
  uint64_t texels = 0;
  for (VolumePart& part : without.parts) {
    texels += texelBytes(part, part.storedMacroblocks());
    part.macroblocks.clear();
    part.voxelBytes.clear();
    part.distances.clear();
    for (auto& plane : part.planeBytes) plane.clear();
  }
  EXPECT_EQ(texels, bytesInMemory(content) - bytesInMemory(without));
}

TEST(VolumePayload, NamesTheRuleThatIsBroken) {
  const auto names = [](const char* rule, const std::function<void(VolumeContent&)>& spoil) {
    VolumeContent content = testContent(2, 2);
    ASSERT_EQ(validationError(content), std::nullopt);
    spoil(content);
    EXPECT_EQ(validationError(content).value_or("none"), rule);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  names("a range is out of bounds", [](VolumeContent& c) { c.featureRange = 0; });
  names("a range is out of bounds", [&](VolumeContent& c) { c.densityRange = nan; });
  names("the steps per texel are out of bounds", [](VolumeContent& c) { c.stepsPerTexel = 0; });
  names("the steps per texel are out of bounds", [](VolumeContent& c) { c.stepsPerTexel = 9; });
  names("the network has no layers, or too many", [](VolumeContent& c) { c.network.clear(); });
  names("the network's layers do not follow one another", [](VolumeContent& c) { c.network[1].inputs = 15; });
  names("a layer of the network has the wrong number of weights or biases",
        [](VolumeContent& c) { c.network[1].weights.pop_back(); });
  names("the network contains a number that is not finite", [&](VolumeContent& c) { c.network[1].biases[0] = nan; });
  names("the network does not end in a colour", [](VolumeContent& c) { c.network.pop_back(); });
  names("there are no parts", [](VolumeContent& c) { c.parts.clear(); });
  names("part 0: its number of voxels is out of bounds", [](VolumeContent& c) { c.parts[0].voxels = 12; });
  names("part 0: its number of plane texels is out of bounds", [](VolumeContent& c) { c.parts[0].planes = 4104; });
  names("part 1: its centre or scale is out of bounds", [&](VolumeContent& c) { c.parts[1].centre[2] = nan; });
  names("part 1: its centre or scale is out of bounds", [](VolumeContent& c) { c.parts[1].scale[2] = 0; });
  names("part 1: its box is empty or out of bounds", [](VolumeContent& c) { c.parts[1].low[1] = 1; });
  names("part 0: it is bounded, but its box is not within its domain",
        [](VolumeContent& c) { c.parts[0].low[0] = -1.1f; });
  names("part 0: a background block is not contracted", [](VolumeContent& c) { c.parts[0].backgroundBlock = true; });
  names("a background block is not alone",
        [](VolumeContent& c) { c.parts[0].backgroundBlock = c.parts[0].contracted = true; });
  names("parts 0 and 1 overlap", [](VolumeContent& c) {
    c.parts[0].high[0] = 1.5f;
    c.parts[0].contracted = true;
  });
  names("part 0: its voxels are not whole macroblocks", [](VolumeContent& c) { c.parts[0].voxelBytes.pop_back(); });
  names("part 0: its macroblock numbers are not those of its grid",
        [](VolumeContent& c) { c.parts[0].macroblocks.pop_back(); });
  const auto firstStored = [](VolumeContent& c) -> uint32_t& {
    for (uint32_t& number : c.parts[0].macroblocks) {
      if (number != VolumePart::kEmpty) return number;
    }
    return c.parts[0].macroblocks[0];
  };
  names("part 0: the number of a macroblock is out of range", [&](VolumeContent& c) { firstStored(c) = 8; });
  names("part 0: a macroblock is used twice", [&](VolumeContent& c) { firstStored(c) = 1; });
  names("part 0: a macroblock is never used", [&](VolumeContent& c) { firstStored(c) = VolumePart::kEmpty; });
  names("part 0: a plane has the wrong number of texels",
        [](VolumeContent& c) { c.parts[0].planeBytes[2].pop_back(); });
  names("part 0: its distances are not those of its cells", [](VolumeContent& c) { c.parts[0].distances.pop_back(); });
}

class VolumeDecoder : public tiles_test::Refusal {
 protected:
  Bytes file() const override { return encodeVolume(testContent(5), 1); }
  bool isRead(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) const override {
    return decodeVolume(file, reason, limits).has_value();
  }
};

TEST_F(VolumeDecoder, RejectsFilesThatAreNoContent) {
  std::string reason;
  EXPECT_FALSE(decodeVolume({}, reason));
  EXPECT_EQ(reason, "is not a binary glTF 2.0 file, or is cut short");
  refuses("its JSON is not that", [](json& asset) { asset = json::array(); });
  refuses("its JSON is not that", [](json& asset) { asset["asset"]["version"] = "1.0"; });
  refuses("has no extension", [](json& asset) { asset.erase("extensions"); });
  refuses("has no extension", [](json& asset) { asset["extensionsUsed"] = {"KHR_x"}; });
  refuses("has version 7; only 1 is supported", [](json& asset) { ours(asset)["version"] = 7; });
  refuses("does not state its version", [](json& asset) { ours(asset).erase("version"); });
  refuses("is not of the representation volume", [](json& asset) { ours(asset)["representation"] = "hash"; });
}

TEST_F(VolumeDecoder, RejectsBufferViewsThatLeaveTheFile) {
  const std::string why = "its buffer views do not lie";
  refuses(why, [](json& asset) { asset["bufferViews"][1]["byteOffset"] = 0xffffffffu; });
  refuses(why, [](json& asset) { asset["bufferViews"][1]["byteLength"] = 1u << 30; });
  refuses(why, [](json& asset) { asset["bufferViews"][1]["byteLength"] = -1; });
  refuses(why, [](json& asset) { asset["bufferViews"][1]["buffer"] = 1; });
  refuses(why, [](json& asset) { asset["buffers"][0]["uri"] = "other.bin"; });
  refuses(why, [](json& asset) { asset["buffers"][0]["byteLength"] = 1u << 30; });
  refuses(why, [](json& asset) { asset["buffers"].push_back({{"byteLength", 1}}); });
  refuses("part 0: its planes", [](json& asset) { part(asset)["planeTexels"][0][0]["bufferView"] = 9999; });
  refuses("part 0: its planes", [](json& asset) { part(asset)["planeTexels"][0][0]["mimeType"] = "image/png"; });
}

TEST_F(VolumeDecoder, RejectsNetworksThatDoNotFit) {
  refuses("has no network", [](json& asset) { ours(asset).erase("network"); });
  refuses("has no network", [](json& asset) { ours(asset)["network"]["layers"] = json(std::vector<json>(9)); });
  refuses("the network has fewer", [](json& asset) { ours(asset)["network"]["layers"][0] = {256, 256}; });
  refuses("a layer of the network is out", [](json& asset) { ours(asset)["network"]["layers"][0] = {34, 1 << 30}; });
  refuses("a layer of the network has no two", [](json& asset) { ours(asset)["network"]["layers"][0] = {34}; });
  refuses("the network has more", [](json& asset) { ours(asset)["network"]["layers"].erase(2); });
  refusesBytes("the network contains a number that is not finite", [](json& asset, Bytes& bytes) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const size_t view = ours(asset)["network"]["bufferView"];
    std::memcpy(bytes.data() + asset["bufferViews"][view]["byteOffset"].get<size_t>() + 40, &nan, 4);
  });
}

TEST_F(VolumeDecoder, RejectsMalformedHeaders) {
  refuses("has no ranges", [](json& asset) { ours(asset)["featureRange"] = "7"; });
  refuses("its steps per texel are out of bounds", [](json& asset) { ours(asset)["stepsPerTexel"] = 9; });
  refuses("its steps per texel are out of bounds", [](json& asset) { ours(asset)["stepsPerTexel"] = 1.5; });
  refuses("the steps per texel are out of bounds", [](json& asset) { ours(asset)["stepsPerTexel"] = 0; });
  refuses("has no parts", [](json& asset) { ours(asset)["parts"] = json::array(); });
  refuses("part 0: its header", [](json& asset) { part(asset)["voxels"] = 0; });
  refuses("part 0: its header", [](json& asset) { part(asset)["voxels"] = 17; });
  refuses("part 0: its header", [](json& asset) { part(asset)["planes"] = 4104; });
  refuses("part 0: its header", [](json& asset) { part(asset)["contracted"] = 1; });
  refuses("part 0: its header", [](json& asset) { part(asset)["centre"] = {1, 2}; });
  refuses("part 0: its header", [](json& asset) { part(asset)["macroblocks"]["stored"] = kMaxStored + 1; });
  refuses("part 0: its centre or scale", [](json& asset) { part(asset)["scale"][1] = 1e300; });
  refuses("part 0: its macroblocks", [](json& asset) { part(asset)["macroblocks"]["stored"] = 1; });
  refuses("part 0: its macroblocks", [](json& asset) { part(asset)["voxels"] = 512; });
  refuses("part 0: its macroblocks", [](json& asset) { part(asset)["macroblocks"].erase("texels"); });
  refuses("part 0: its planes", [](json& asset) { part(asset)["planes"] = 32; });
  refuses("part 0: its planes", [](json& asset) { part(asset)["planeTexels"].erase(2); });
  refuses("part 0: its occupied cells", [](json& asset) { part(asset).erase("occupied"); });
}

TEST_F(VolumeDecoder, RejectsMoreMemoryThanAllowedBeforeAllocatingIt) {
  ContentLimits limits;
  limits.bytes = 20000;
  refuses(
      "takes more than 20000 bytes of memory", [](json&) {}, limits);
  refuses("takes more than 1073741824 bytes of memory", [](json& asset) {
    const json one = part(asset);
    for (int i = 0; i < 5; ++i) {
      ours(asset)["parts"].push_back(one);
      ours(asset)["parts"].back()["planes"] = 4096;
    }
  });
  limits = {};
  limits.parts = 1;
  refuses(
      "has no parts, or too many", [](json& asset) { ours(asset)["parts"].push_back(part(asset)); }, limits);
}

TEST_F(VolumeDecoder, RejectsPicturesWithUnexpectedPixels) {
  refusesBytes("part 0: its occupied cells", [](json& asset, Bytes& bytes) {  // sets bits beyond the 27 cells
    replace(asset, bytes, part(asset)["occupied"], ImageU8(256, 1, 3, 255));
  });
  refusesBytes("part 0: its occupied cells", [](json& asset, Bytes& bytes) {  // the last byte stores three cells
    ImageU8 beyond(256, 1, 3);
    std::fill_n(beyond.at(3, 0), 3, uint8_t{8});
    replace(asset, bytes, part(asset)["occupied"], beyond);
  });
  refusesBytes("part 0: its occupied cells", [](json& asset, Bytes& bytes) {
    ImageU8 coloured(256, 1, 3);
    coloured.pixels[0] = 1;
    replace(asset, bytes, part(asset)["occupied"], coloured);
  });
  refusesBytes("part 0: its macroblocks", [](json& asset, Bytes& bytes) {  // more occupied than stored
    ImageU8 all(256, 1, 3);
    for (int c = 0; c < 3; ++c) all.pixels[static_cast<size_t>(c)] = 255;
    replace(asset, bytes, part(asset)["macroblocks"]["alive"], all);
  });
  refusesBytes("part 0: its planes", [](json& asset, Bytes& bytes) {  // blue of the last picture is no attribute
    replace(asset, bytes, part(asset)["planeTexels"][1][2], ImageU8(24, 24, 3, 1));
  });
}

TEST_F(VolumeDecoder, RejectsEveryTruncationAndSurvivesChangedBytes) {
  const Bytes file = encodeVolume(testContent(6), 1);
  std::string reason;
  const RandomStream random(4, 4);
  for (uint64_t trial = 0; trial < 200; ++trial) {
    Bytes spoilt = file;
    if (trial % 2 == 0) {
      spoilt.resize(random.below(2 * trial, static_cast<uint32_t>(file.size())));
      EXPECT_FALSE(decodeVolume(spoilt, reason));
    } else {
      spoilt[random.below(2 * trial, static_cast<uint32_t>(file.size()))] ^=
          std::byte(1 + random.below(2 * trial + 1, 255));
      const bool isAccepted = decodeVolume(spoilt, reason).has_value();
      EXPECT_EQ(isAccepted, reason.empty());
    }
  }
}

TEST(VolumeContent, CountsAllOfItsMemory) {
  VolumeContent content;
  const uint64_t before = bytesInMemory(content);
  content.network = {{34, 3, std::vector<float>(102), std::vector<float>(3)}};
  EXPECT_EQ(bytesInMemory(content) - before, sizeof(DenseLayer) + 4 * 105);
  const uint64_t withNetwork = bytesInMemory(content);
  content.parts.resize(1);
  content.parts[0].macroblocks.resize(64);
  content.parts[0].voxelBytes.resize(5832);
  content.parts[0].planeBytes[2].resize(1000);
  content.parts[0].distances.resize(512);
  EXPECT_EQ(bytesInMemory(content) - withNetwork, sizeof(VolumePart) + 256 + 5832 + 1000 + 512);
}

}  // namespace
}  // namespace tessera
