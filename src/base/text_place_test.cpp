#include "base/text_place.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(TextPlace, IsALineAndAColumnInCharacters) {
  EXPECT_EQ(placeInText("", 0), "line 1, column 1");
  EXPECT_EQ(placeInText("abc", 1), "line 1, column 1");
  EXPECT_EQ(placeInText("abc", 3), "line 1, column 3");
  EXPECT_EQ(placeInText("a\nbc", 3), "line 2, column 1");
  EXPECT_EQ(placeInText("a\n\xc3\xa4"
                        "c",
                        5),
            "line 2, column 2");
  EXPECT_EQ(placeInText("a", 9), "line 1, column 2") << "behind the end";
}

}  // namespace
}  // namespace tessera
