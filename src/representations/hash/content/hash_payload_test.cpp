#include "representations/hash/content/hash_payload.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/random.h"
#include "raymarch/content/texel_pictures.h"
#include "raymarch/testing/content_refusal.h"
#include "representations/hash/testing/random_content.h"
#include "tiles/content_file.h"
#include "tiles/glb.h"
#include "tiles/lossless_image.h"
#include "tiles/read_content.h"

namespace tessera {
namespace {

using nlohmann::json;
using tiles_test::TestHashContent;
using tiles_test::testHashContent;

void expectSame(const HashContent& a, const HashContent& b) {
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.logits, b.logits);
  EXPECT_EQ(a.step, b.step);
  EXPECT_EQ(a.hasLearnedBackground, b.hasLearnedBackground);
  EXPECT_TRUE(a.network == b.network);
  ASSERT_EQ(a.parts.size(), b.parts.size());
  for (size_t i = 0; i < a.parts.size(); ++i) {
    const HashPart &one = a.parts[i], &other = b.parts[i];
    tiles_test::expectSamePlace(one, other);
    EXPECT_EQ(one.lattice, other.lattice);
    EXPECT_EQ(one.columns, other.columns);
    EXPECT_EQ(one.ranges, other.ranges);
    EXPECT_EQ(one.cornerBytes, other.cornerBytes);
    ASSERT_EQ(one.tables.size(), other.tables.size());
    for (size_t l = 0; l < one.tables.size(); ++l) {
      EXPECT_EQ(one.tables[l].resolution, other.tables[l].resolution);
      EXPECT_EQ(one.tables[l].entries, other.tables[l].entries);
      EXPECT_EQ(one.tables[l].hashed, other.tables[l].hashed);
      EXPECT_EQ(one.tables[l].ranges, other.tables[l].ranges);
      EXPECT_EQ(one.tables[l].bytes, other.tables[l].bytes);
    }
    EXPECT_EQ(one.occupied.levels, other.occupied.levels);
    EXPECT_EQ(one.distances, other.distances);
  }
}

std::optional<HashContent> roundTrip(const HashContent& content) {
  std::string reason;
  auto again = decodeHash(encodeHash(content, 1), reason);
  EXPECT_TRUE(again) << reason;
  return again;
}

TEST(ByteRange, EncodesWhatItCannotHoldAtItsEnds) {
  const ByteRange range{-1, 1};
  EXPECT_EQ(range.encodeByte(-1), 0);
  EXPECT_EQ(range.encodeByte(1), 255);
  EXPECT_EQ(range.encodeByte(-3), 0);
  EXPECT_EQ(range.encodeByte(3), 255);
  EXPECT_EQ(range.encodeByte(std::numeric_limits<float>::infinity()), 255);
  EXPECT_EQ(range.encodeByte(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_EQ((ByteRange{2, 2}.encodeByte(2)), 0);
  EXPECT_EQ((ByteRange{0, std::numeric_limits<float>::denorm_min()}.encodeByte(0)), 0);
}

TEST(HashPayload, GivesBackWhatWasWritten) {
  uint64_t seed = 0;
  for (const LevelWeights weights : {LevelWeights::none, LevelWeights::shared, LevelWeights::separate}) {
    for (const bool varies : {true, false}) {
      TestHashContent options;
      options.weights = weights;
      options.varies = varies;
      options.levels = static_cast<uint32_t>(1 + seed % 4);
      ++seed;
      HashContent content = testHashContent(seed, static_cast<uint32_t>(1 + seed % 3), options);
      content.hasLearnedBackground = varies;
      const auto again = roundTrip(content);
      ASSERT_TRUE(again);
      expectSame(content, *again);
    }
  }
}

TEST(HashPayload, GivesBackBackgroundBlocksOddNumbersAndTablesThatFillNoRow) {
  TestHashContent options;
  options.entries = 1000;
  HashContent content = testHashContent(7, 1, options);
  content.parts[0].tables[1].hashed = false;
  content.parts[0].tables[1].resolution = 10;
  HashPart& part = content.parts[0];
  part.contracted = part.backgroundBlock = true;
  part.centre = {0.1f, 1e-30f, -3};
  part.low = {-1e6f, -1e6f, -1e6f};
  part.high = {1e6f, 1e6f, 1e6f};
  part.ranges[3] = {-0.0f, std::numeric_limits<float>::denorm_min()};
  const auto again = roundTrip(content);
  ASSERT_TRUE(again);
  expectSame(content, *again);
}

TEST(HashPayload, GivesBackAPartWithoutMacroblocks) {
  HashContent content = testHashContent(8);
  content.parts[0].macroblocks.assign(8, HashPart::kEmpty);
  content.parts[0].cornerBytes.clear();
  const auto again = roundTrip(content);
  ASSERT_TRUE(again);
  expectSame(content, *again);
}

TEST(HashPayload, RenumbersMacroblocksInTheOrderOfTheirPlaces) {
  const HashContent content = testHashContent(9);
  HashContent shuffled = content;
  HashPart& part = shuffled.parts[0];
  const uint32_t stored = part.storedMacroblocks();
  ASSERT_GE(stored, 2u);
  const size_t bytes = size_t{HashPart::kStoredTexels} * part.columns;
  for (uint32_t& number : part.macroblocks) {
    if (number != HashPart::kEmpty) number = stored - 1 - number;
  }
  for (uint32_t i = 0; i < stored; ++i) {
    std::memcpy(part.cornerBytes.data() + i * bytes, content.parts[0].cornerBytes.data() + (stored - 1 - i) * bytes,
                bytes);
  }
  const auto again = roundTrip(shuffled);
  ASSERT_TRUE(again);
  expectSame(content, *again);
}

TEST(HashPayload, ReportsItsMemoryFromHeadersAlone) {
  const fs::path path = fs::temp_directory_path() / ("tessera-hash-file-" + std::to_string(::getpid()) + ".glb");
  const HashContent content = testHashContent(5, 2);
  writeFileAtomically(path, encodeHash(content, 1));
  EXPECT_EQ(readDecodedBytes(path, hashCodec()), bytesInMemory(content));
  EXPECT_EQ(readContent(path, hashCodec())->memoryBytes(), bytesInMemory(content));
  std::string reason;
  EXPECT_FALSE(decodeContentFile(readFile(path), "another", reason));
  EXPECT_EQ(reason, "is not of the representation another");
  fs::remove(path);
}

TEST(HashPayload, CountsTheBytesThatItsPartsHold) {
  const HashContent content = testHashContent(3);
  const HashPart& part = content.parts[0];
  uint64_t bytes = sizeof(HashPart) + part.ranges.size() * sizeof(ByteRange) + part.macroblocks.size() * 4 +
                   part.cornerBytes.size() + 4 * (part.distances.coarse.size() + part.distances.fine.size());
  for (const HashTable& table : part.tables) bytes += sizeof(HashTable) + table.bytes.size();
  for (const OccupancyBits& level : part.occupied.levels) bytes += sizeof(OccupancyBits) + 8 * level.words.size();
  EXPECT_EQ(hashPartBytes(part, part.storedMacroblocks(), part.cells(), part.distances.nearCells()), bytes);
}

TEST(HashPayload, HasPicturesThatWebPCanHoldUpToItsBounds) {
  const uint64_t cells = kMaxOccupancyCells;
  for (const PictureSize& size : {sizeOfBits(cells * cells * cells), sizeOfList(kMaxTableEntries)}) {
    EXPECT_LE(size.width, static_cast<uint32_t>(kLargestLosslessSide));
    EXPECT_LE(size.height, static_cast<uint32_t>(kLargestLosslessSide));
  }
}

TEST(HashPayload, NamesTheRuleThatIsBroken) {
  const auto names = [](const char* rule, const std::function<void(HashContent&)>& spoil) {
    HashContent content = testHashContent(2, 2);
    ASSERT_EQ(validationError(content), std::nullopt);
    spoil(content);
    EXPECT_EQ(validationError(content).value_or("none"), rule);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  names("the step is out of bounds", [](HashContent& c) { c.step = 0; });
  names("the step is out of bounds", [&](HashContent& c) { c.step = nan; });
  names("the network's layers do not follow one another", [](HashContent& c) { c.network[0].inputs = 34; });
  names("the network is too large for a shader", [](HashContent& c) {
    const auto layer = [](uint32_t inputs, uint32_t outputs) {
      return DenseLayer{inputs, outputs, std::vector<float>(size_t{inputs} * outputs), std::vector<float>(outputs)};
    };
    c.network = {layer(23, 128), layer(128, 128), layer(128, 3)};
  });
  names("there are no parts", [](HashContent& c) { c.parts.clear(); });
  names("its logits are not those of its tables", [](HashContent& c) { c.logits = {1, 2, 3}; });
  names("a logit is out of bounds", [&](HashContent& c) { c.logits = {1, 2, 3, nan}; });
  names("part 0: its columns are not those that its weights need", [](HashContent& c) { c.logits = {1, 2, 3, 4}; });
  names("part 1: its lattice is out of bounds", [](HashContent& c) { c.parts[1].lattice = 12; });
  names("part 0: its ranges are not those of its columns", [](HashContent& c) { c.parts[0].ranges.pop_back(); });
  names("part 0: a range is out of bounds", [&](HashContent& c) { c.parts[0].ranges[3].high = nan; });
  names("part 0: a range is out of bounds", [](HashContent& c) { c.parts[0].tables[1].ranges[3] = {1, 0}; });
  names("part 1: its centre or scale is out of bounds", [](HashContent& c) { c.parts[1].scale[2] = 0; });
  names("part 0: its voxels are not whole macroblocks", [](HashContent& c) { c.parts[0].cornerBytes.pop_back(); });
  names("part 0: it has no tables, or too many", [](HashContent& c) {
    c.parts[0].tables.clear();
    c.parts[1].tables.clear();
  });
  names("part 1: parts differ in their number of tables", [](HashContent& c) { c.parts[1].tables.pop_back(); });
  names("part 0: the resolution of a table is out of bounds",
        [](HashContent& c) { c.parts[0].tables[1].resolution = 1; });
  names("part 0: a table has no entries, or too many", [](HashContent& c) { c.parts[0].tables[1].entries = 0; });
  names("part 0: the entries of a hashed table are not a power of two",
        [](HashContent& c) { c.parts[0].tables[1].entries = 500; });
  names("part 0: a table that is not hashed has fewer entries than points",
        [](HashContent& c) { c.parts[0].tables[0].resolution = 9; });
  names("part 0: a table has the wrong number of entries",
        [](HashContent& c) { c.parts[0].tables[1].bytes.pop_back(); });
  names("part 0: its occupancy is out of bounds", [](HashContent& c) { c.parts[0].occupied.levels.clear(); });
  names("part 0: its occupancy is out of bounds", [](HashContent& c) { c.parts[0].occupied.levels[0].cells = 12; });
  names("part 0: its distances are not those of its cells",
        [](HashContent& c) { c.parts[0].distances.coarse.pop_back(); });
}

class HashDecoder : public tiles_test::Refusal {
 protected:
  Bytes file() const override { return encodeHash(testHashContent(5), 1); }
  bool isRead(std::span<const std::byte> file, std::string& reason, const ContentLimits& limits) const override {
    return decodeHash(file, reason, limits).has_value();
  }
};

TEST_F(HashDecoder, RejectsMalformedHeaders) {
  refuses("is not of the representation hash", [](json& asset) { ours(asset)["representation"] = "volume"; });
  const std::string missing = "weights, step or learned_background is missing or malformed";
  refuses(missing, [](json& asset) { ours(asset)["weights"] = "some"; });
  refuses(missing, [](json& asset) { ours(asset)["step"] = "long"; });
  refuses(missing, [](json& asset) { ours(asset).erase("learned_background"); });
  refuses("the key whole is called learned_background now", [](json& asset) { ours(asset)["whole"] = true; });
  refuses("the step is out of bounds", [](json& asset) { ours(asset)["step"] = 1e-9; });
  refuses("its logits are not a list, or", [](json& asset) { ours(asset)["logits"] = json::array(); });
  refuses("its logits are not a list, or", [](json& asset) { ours(asset)["logits"] = json(std::vector<float>(17)); });
  refuses("a logit is not a number", [](json& asset) { ours(asset)["logits"] = {"a"}; });
  refuses("has no parts", [](json& asset) { ours(asset)["parts"] = json::array(); });
  const std::string header = "part 0: its header";
  refuses(header, [](json& asset) { part(asset)["lattice"] = 17; });
  refuses(header, [](json& asset) { part(asset)["lattice"] = 2048; });
  refuses(header, [](json& asset) { part(asset)["cells"] = 0; });
  refuses(header, [](json& asset) { part(asset)["cells"] = 1024; });
  refuses(header, [](json& asset) { part(asset)["ranges"].erase(3); });
  refuses(header, [](json& asset) { part(asset)["ranges"][3] = {1}; });
  refuses(header, [](json& asset) { part(asset)["tables"] = json::array(); });
  refuses(header, [](json& asset) { part(asset)["tables"][1]["entries"] = 0; });
  refuses(header, [](json& asset) { part(asset)["tables"][1]["entries"] = 1 << 25; });
  refuses(header, [](json& asset) { part(asset)["tables"][1]["hashed"] = 1; });
  refuses(header, [](json& asset) { part(asset)["tables"][1]["ranges"] = json::array(); });
  refuses(header, [](json& asset) { ours(asset)["logits"] = {1, 2, 3, 4}; });  // 16 columns instead of 8
  refuses("part 0: a range is out of bounds", [](json& asset) { part(asset)["ranges"][3] = {1e30, 1e31}; });
  refuses("part 0: its macroblocks", [](json& asset) { part(asset)["macroblocks"]["stored"] = 1; });
  refuses("part 0: its macroblocks", [](json& asset) { part(asset)["macroblocks"]["texels"].erase(5); });
  refuses("part 0: its tables", [](json& asset) { part(asset)["tables"][1]["texels"].erase(2); });
  refuses("part 0: its tables", [](json& asset) { part(asset)["tables"][1]["entries"] = 1024; });
  refuses("part 0: its occupied cells", [](json& asset) { part(asset)["cells"] = 32; });
  refuses(header, [](json& asset) { part(asset)["cells"] = 136; });  // does not state the number of near cells
}

TEST_F(HashDecoder, RejectsWrongNumbersOfNearCells) {
  HashContent content = testHashContent(5);
  HashPart& part = content.parts[0];
  OccupancyBits occupied(136);
  occupied.set(7);
  occupied.set(occupied.number(90, 90, 90));
  part.occupied = pyramidFromOccupancy(std::move(occupied));
  part.distances = octantDistances(part.occupied);
  const auto again = roundTrip(content);
  ASSERT_TRUE(again);
  expectSame(content, *again);
  const Bytes file = encodeHash(content, 1);
  const auto view = decodeGlb(file);
  for (const json& lie : {json(1), json(3), json(-1), json(1e9), json("2")}) {
    json asset = json::parse(view->json);
    EXPECT_EQ(asset["extensions"]["TESSERA_content"]["parts"][0]["nearCells"], 2);
    asset["extensions"]["TESSERA_content"]["parts"][0]["nearCells"] = lie;
    std::string reason;
    EXPECT_FALSE(decodeHash(encodeGlb(asset.dump(), view->bytes), reason));
    EXPECT_EQ(reason.substr(0, 7), "part 0:");
  }
}

TEST_F(HashDecoder, RejectsContentsAboveTheMemoryLimitBeforeAllocating) {
  ContentLimits limits;
  limits.bytes = 20000;
  refuses(
      "takes more than 20000 bytes of memory", [](json&) {}, limits);
  refuses("takes more than 1073741824 bytes of memory", [](json& asset) {
    const json table = part(asset)["tables"][1];
    for (int i = 0; i < 8; ++i) {
      if (i > 1) part(asset)["tables"].push_back(table);
      part(asset)["tables"][static_cast<size_t>(i)]["entries"] = 1 << 24;
    }
  });
}

TEST_F(HashDecoder, RejectsImagesWithUnexpectedChannelValues) {
  refusesBytes("part 0: its tables", [](json& asset, Bytes& bytes) {  // 512 entries: two rows of 256
    replace(asset, bytes, part(asset)["tables"][0]["texels"][2], ImageU8(256, 2, 3, 1));
  });
  refusesBytes("part 0: its occupied cells", [](json& asset, Bytes& bytes) {
    ImageU8 coloured(256, 2, 3);
    coloured.pixels[0] = 1;
    replace(asset, bytes, part(asset)["occupied"], coloured);
  });
}

TEST_F(HashDecoder, RejectsTruncatedFilesAndSurvivesCorruptedBytes) {
  const Bytes file = encodeHash(testHashContent(6), 1);
  std::string reason;
  const RandomStream random(4, 4);
  for (uint64_t trial = 0; trial < 200; ++trial) {
    Bytes spoilt = file;
    if (trial % 2 == 0) {
      spoilt.resize(random.below(2 * trial, static_cast<uint32_t>(file.size())));
      EXPECT_FALSE(decodeHash(spoilt, reason));
    } else {
      spoilt[random.below(2 * trial, static_cast<uint32_t>(file.size()))] ^=
          std::byte(1 + random.below(2 * trial + 1, 255));
      const bool isAccepted = decodeHash(spoilt, reason).has_value();
      EXPECT_EQ(isAccepted, reason.empty());
    }
  }
}

}  // namespace
}  // namespace tessera
