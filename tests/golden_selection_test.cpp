// Tests that the selection still matches selection.json; web/src/stream tests its counterpart against the same file.
#include "golden/golden_selection.h"

#include <gtest/gtest.h>

#include "base/file.h"

namespace tessera {
namespace {

TEST(GoldenSelection, IsWhatTheSelectorChooses) {
  const auto expected = nlohmann::ordered_json::parse(readTextFile(TESSERA_GOLDEN_SELECTION));
  const auto actual = nlohmann::ordered_json::parse(golden::makeSelections().dump());
  ASSERT_EQ(actual["views"].size(), expected["views"].size());
  int refused = 0, instead = 0, unlike = 0;
  for (size_t i = 0; i < actual["views"].size(); ++i) {
    for (const char* key : {"requested", "refused", "sharing", "cut", "backgroundBlock"}) {
      EXPECT_EQ(actual["views"][i][key], expected["views"][i][key]) << "view " << i << ", " << key;
    }
    refused += expected["views"][i]["refused"].get<int>() > 0;
    unlike += expected["views"][i]["sharing"]["requested"] != expected["views"][i]["requested"];
    for (const auto& one : expected["views"][i]["cut"]) instead += one[0] != one[1];
  }
  EXPECT_GT(refused, 20);
  EXPECT_GT(instead, 20);
  EXPECT_GT(unlike, 20) << "resources take room";
  EXPECT_EQ(actual["tree"], expected["tree"]);
}

}  // namespace
}  // namespace tessera
