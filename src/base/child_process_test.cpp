#include "base/child_process.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(ChildProcess, PassesArgumentsAsTheyAre) {
  ChildProcess process;
  ASSERT_EQ(process.start({"printf", "%s|", "a b", "$HOME; 'c'"}), "");
  EXPECT_TRUE(process.isRunning());
  EXPECT_EQ(process.wait(), "");
  EXPECT_FALSE(process.isRunning());
  EXPECT_EQ(process.lastWords(), "a b|$HOME; 'c'|");
}

TEST(ChildProcess, ReportsHowItEnded) {
  ChildProcess process;
  ASSERT_EQ(process.start({"sh", "-c", "echo no memory >&2; exit 3"}), "");
  EXPECT_EQ(process.wait(), "ended with status 3");
  EXPECT_EQ(process.lastWords(), "no memory");
  ASSERT_EQ(process.start({"sh", "-c", "kill -9 $$"}), "");
  EXPECT_EQ(process.wait(), "was ended by signal 9");
  ASSERT_EQ(process.start({"cat"}), "") << "it has no input to wait for";
  EXPECT_EQ(process.wait(), "");
}

TEST(ChildProcess, SaysWhyAProgramCannotBeStarted) {
  ChildProcess process;
  EXPECT_EQ(process.start({"no-such-program"}), "No such file or directory");
  EXPECT_FALSE(process.isRunning());
}

}  // namespace
}  // namespace tessera
