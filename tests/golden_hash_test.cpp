// Tests that the committed scene of `hash` can be read, which a change of the format would break.
#include "golden/golden_hash.h"

#include "golden_scene_test.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/cpu/hash_drawer.h"

namespace tessera {
namespace {

const fs::path kHashScene = TESSERA_GOLDEN_HASH;

TEST(GoldenHash, MatchesTheExpectedSumsAndItsGenerator) {
  const nlohmann::ordered_json expected = readGoldenJson(kHashScene / "sums.json");
  EXPECT_EQ(expected.size(), 5u);
  const golden::Scene<HashContent> scene = golden::makeHashScene();
  forEachGoldenContent<HashContent>(
      kHashScene, hashCodec(), [&](const auto& uri, const auto& name, const HashContent& hash) {
        const HashContent& source = scene.contents.at(name);
        const auto& sums = expected.at(uri);
        ASSERT_EQ(hash.parts.size(), sums.size());
        EXPECT_EQ(hash.weights, source.weights);
        EXPECT_EQ(hash.logits, source.logits);
        EXPECT_EQ(hash.step, source.step);
        for (size_t l = 0; l < source.network.size(); ++l)
          EXPECT_EQ(hash.network[l].weights, source.network[l].weights);
        for (size_t i = 0; i < sums.size(); ++i) {
          EXPECT_EQ(golden::toJson(golden::computeSums(hash.parts[i])), sums[i]) << uri << " part " << i;
          EXPECT_EQ(golden::toJson(golden::computeSums(source.parts[i])), sums[i]) << uri << " part " << i;
          EXPECT_EQ(hash.parts[i].ranges, source.parts[i].ranges);
        }
      });
}

TEST(GoldenHash, RendersItsRaysAsTheDefinitionSays) {
  expectRaysAsDefined<HashContent>(kHashScene, hashCodec());
}

}  // namespace
}  // namespace tessera
