#include "base/error.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(Error, ReadsAsOneSentenceWithTheRemedyLast) {
  const Error error("a.png", "row 3", "is cut short", "copy it again");
  EXPECT_STREQ(error.what(), "a.png: row 3: is cut short; copy it again");
  EXPECT_EQ(error.subject(), "a.png");
  EXPECT_EQ(error.place(), "row 3");
  EXPECT_EQ(error.reason(), "is cut short");
  EXPECT_EQ(error.remedy(), "copy it again");
}

TEST(Error, LeavesOutAnEmptyPlaceAndRemedy) {
  EXPECT_STREQ(Error("a", "", "b", "").what(), "a: b");
}

TEST(Error, StaysOnOneLineWhateverTheFileIsCalled) {
  EXPECT_STREQ(Error("a\nb", "", "c\r", "d").what(), "a b: c ; d");
}

}  // namespace
}  // namespace tessera
