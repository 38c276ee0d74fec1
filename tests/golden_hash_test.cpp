// The committed scene of `hash`, read: what a change of the format would break.
#include "golden/golden_hash.h"

#include "golden_scene_test.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/cpu/hash_drawer.h"

namespace tessera {
namespace {

const fs::path kHashScene = TESSERA_GOLDEN_HASH;

TEST(GoldenHash, IsReadToTheExpectedSumsAndHoldsWhatItWasMadeFrom) {
  const nlohmann::ordered_json expected = readGoldenJson(kHashScene / "sums.json");
  EXPECT_EQ(expected.size(), 5u);
  const golden::Scene<HashContent> scene = golden::makeHashScene();
  forEachGoldenContent<HashContent>(
      kHashScene, hashCodec(), [&](const auto& uri, const auto& name, const HashContent& hash) {
        const HashContent& made = scene.contents.at(name);
        const auto& sums = expected.at(uri);
        ASSERT_EQ(hash.parts.size(), sums.size());
        EXPECT_EQ(hash.weights, made.weights);
        EXPECT_EQ(hash.logits, made.logits);
        EXPECT_EQ(hash.step, made.step);
        for (size_t l = 0; l < made.network.size(); ++l) EXPECT_EQ(hash.network[l].weights, made.network[l].weights);
        for (size_t i = 0; i < sums.size(); ++i) {
          EXPECT_EQ(golden::toJson(golden::sumsOf(hash.parts[i])), sums[i]) << uri << " part " << i;
          EXPECT_EQ(golden::toJson(golden::sumsOf(made.parts[i])), sums[i]) << uri << " part " << i;
          EXPECT_EQ(hash.parts[i].ranges, made.parts[i].ranges);
        }
      });
}

TEST(GoldenHash, LooksAlongItsRaysAsTheDefinitionSays) {
  expectRaysAsDefined<HashContent>(kHashScene, hashCodec());
}

}  // namespace
}  // namespace tessera
