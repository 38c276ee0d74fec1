#include "base/check.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

struct Unprintable {
  bool operator==(const Unprintable&) const { return false; }
};

TEST(Check, PassesSilentlyWhenTheConditionHolds) {
  int evaluations = 0;
  CHECK(++evaluations == 1);
  EXPECT_EQ(evaluations, 1);
  CHECK((evaluations == 1 || evaluations == 7));
}

TEST(CheckDeathTest, PrintsTheExpressionAndBothValues) {
  const int shown = 41;
  EXPECT_DEATH(CHECK(shown == 42), "check_test.cpp:[0-9]+: CHECK\\(shown == 42\\) failed: 41 against 42");
  EXPECT_DEATH(CHECK(shown < 3), "41 against 3");
  EXPECT_DEATH(CHECK((shown < 3 || shown > 50)), "false");
}

TEST(CheckDeathTest, ComparesWhatCannotBePrinted) {
  EXPECT_DEATH(CHECK(Unprintable{} == Unprintable{}), "\\(unprintable\\) against \\(unprintable\\)");
}

}  // namespace
}  // namespace tessera
