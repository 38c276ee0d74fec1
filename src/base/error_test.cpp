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

TEST(Error, ShowsControlCharactersAsTextThatATerminalDoesNotObey) {
  EXPECT_STREQ(Error("a\x1b[2J", std::string("\0", 1), "\x7f\t\xc2\x9b", "\xc2").what(),
               "a\\x1b[2J: \\x00: \\x7f\\x09\\u009b; \xc2");
  EXPECT_STREQ(Error("\xc2\xa0\xc3\xa4\xe2\x82\xac", "", "b", "").what(), "\xc2\xa0\xc3\xa4\xe2\x82\xac: b")
      << "letters of other alphabets stay";
  EXPECT_EQ(Error("a\x1b", "", "b", "").subject(), "a\x1b");
}

}  // namespace
}  // namespace tessera
