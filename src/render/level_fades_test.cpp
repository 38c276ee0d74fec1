#include "render/level_fades.h"

#include <gtest/gtest.h>

#include "base/random.h"
#include "render/testing/test_tree.h"

namespace tessera {
namespace {

constexpr int kFrames = 3;

TileCut makeCut(const std::vector<std::pair<int, int>>& tilesAndContents) {
  TileCut cut;
  for (const auto& [tile, content] : tilesAndContents) cut.tiles.push_back({tile, content, content >= 0});
  return cut;
}

bool holdsAll(int) {
  return true;
}

using Drawn = std::vector<FadedTile>;

class LevelFadesOfQuarters : public testing::Test {
 protected:
  Drawn next(const std::vector<std::pair<int, int>>& cut) { return fades_.next(makeCut(cut), holdsAll); }

  const TileTree tree_ = testTree(2, 2);  // tile 0 above 1 to 4
  LevelFades fades_{tree_, kFrames};
};

TEST_F(LevelFadesOfQuarters, DrawTheFirstCutAndWhatIsNewlyVisibleAtOnce) {
  EXPECT_EQ(next({{1, 1}, {2, -1}}), (Drawn{{1, 1}}));
  EXPECT_EQ(next({{1, 1}, {2, 2}}), (Drawn{{1, 1}, {2, 2}}));
  EXPECT_FALSE(fades_.isFading());
}

TEST_F(LevelFadesOfQuarters, MoveFromTheCoarseContentToTheFineOne) {
  next({{0, 0}});
  for (int frame = 1; frame <= kFrames; ++frame) {
    const float share = frame / 4.0f;
    EXPECT_EQ(next({{1, 1}, {2, 0}}), (Drawn{{1, 1, 0, share}, {1, 0, share, 1}, {2, 0}})) << frame;
    EXPECT_TRUE(fades_.isFading());
  }
  EXPECT_EQ(next({{1, 1}, {2, 0}}), (Drawn{{1, 1}, {2, 0}}));
  EXPECT_FALSE(fades_.isFading());
}

TEST_F(LevelFadesOfQuarters, MoveFromFineContentsToTheCoarseOneInTheirCells) {
  next({{1, 1}, {3, 3}});
  EXPECT_EQ(next({{0, 0}}),
            (Drawn{{1, 0, 0, 0.25f}, {1, 1, 0.25f, 1}, {2, 0}, {3, 0, 0, 0.25f}, {3, 3, 0.25f, 1}, {4, 0}}));
  for (int frame = 2; frame <= kFrames; ++frame) next({{0, 0}});
  EXPECT_EQ(next({{0, 0}}), (Drawn{{0, 0}}));
}

TEST_F(LevelFadesOfQuarters, TurnBackFromWhereTheyAre) {
  next({{0, 0}});
  next({{1, 1}});
  next({{1, 1}});  // half of the pixels
  EXPECT_EQ(next({{0, 0}}).front(), (FadedTile{1, 0, 0, 0.5f}));
  EXPECT_EQ(next({{1, 1}}), (Drawn{{1, 1, 0, 0.5f}, {1, 0, 0.5f, 1}}));
}

TEST_F(LevelFadesOfQuarters, EndWhenTheOldContentIsEvictedOrTheyAreReset) {
  next({{0, 0}});
  next({{1, 1}});
  EXPECT_EQ(fades_.next(makeCut({{1, 1}}), [](int tile) { return tile != 0; }), (Drawn{{1, 1}}));
  next({{1, 0}});
  ASSERT_TRUE(fades_.isFading());
  fades_.reset();
  EXPECT_EQ(next({{1, 1}}), (Drawn{{1, 1}}));
}

// Every place is drawn with every threshold exactly once, whatever the cuts are.
TEST(LevelFades, CoverEachPlaceOnceInRandomSequencesOfCuts) {
  const TileTree tree = testTree(4, 4);
  const RandomStream random(7, 1);
  uint64_t drawnTwice = 0, next = 0;
  LevelFades fades(tree, kFrames);
  for (int frame = 0; frame < 400; ++frame) {
    TileCut cut;
    const std::function<void(int, int)> cover = [&](int tile, int above) {
      const bool isHeld = above < 0 || random.below(next++, 3) > 0;
      const int content = isHeld ? tile : above;
      if (!tree.tiles[tile].children.empty() && random.below(next++, 3) > 0) {
        for (const int child : tree.tiles[tile].children) cover(child, content);
      } else {
        cut.tiles.push_back({tile, content, true});
      }
    };
    cover(0, -1);
    const std::vector<FadedTile> drawn = fades.next(cut, [&](int) { return random.below(next++, 4) > 0; });
    for (int leaf = 0; leaf < static_cast<int>(tree.tiles.size()); ++leaf) {
      if (!tree.tiles[leaf].children.empty()) continue;
      float covered = 0;
      int contents = 0;
      for (const FadedTile& one : drawn) {
        int above = leaf;
        while (above >= 0 && above != one.tile) above = tree.tiles[above].parent;
        if (above < 0) continue;
        covered += one.high - one.low;
        ++contents;
      }
      EXPECT_NEAR(covered, 1, 1e-6) << "frame " << frame << ", tile " << leaf;
      EXPECT_LE(contents, 2);
      drawnTwice += contents == 2;
    }
  }
  EXPECT_GT(drawnTwice, 1000u);
}

}  // namespace
}  // namespace tessera
