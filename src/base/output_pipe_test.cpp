#include "base/output_pipe.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace tessera {
namespace {

TEST(OutputPipe, GivesTheOutputAndKeepsMessagesApart) {
  OutputPipe pipe;
  ChildProcess process;
  ASSERT_EQ(process.start({"sh", "-c", "printf abcdefg; echo trouble >&2"}, {.output = pipe.writeEnd()}), "");
  std::byte first[3];
  EXPECT_EQ(pipe.read(first), 3u);
  EXPECT_EQ(first[2], std::byte{'c'});
  EXPECT_EQ(pipe.readText(100), "defg");
  EXPECT_EQ(pipe.read(first), 0u) << "the output has ended";
  EXPECT_EQ(process.wait(), "");
  EXPECT_EQ(process.lastWords(), "trouble");
}

TEST(OutputPipe, HasMoreThanItsBufferHolds) {
  OutputPipe pipe;
  ChildProcess process;
  ASSERT_EQ(process.start({"head", "-c", "5000000", "/dev/zero"}, {.output = pipe.writeEnd()}), "");
  std::vector<std::byte> bytes(6000000);
  EXPECT_EQ(pipe.read(bytes), 5000000u);
  EXPECT_EQ(process.wait(), "");
}

TEST(OutputPipe, ReadsNoMoreTextThanAllowed) {
  OutputPipe pipe;
  ChildProcess process;
  ASSERT_EQ(process.start({"head", "-c", "5000000", "/dev/zero"}, {.output = pipe.writeEnd()}), "");
  EXPECT_EQ(pipe.readText(20000).size(), 20000u);
}

TEST(OutputPipe, CanBeLeftWhileAProgramSaysNothing) {
  OutputPipe pipe;
  ChildProcess process;
  ASSERT_EQ(process.start({"sleep", "600"}, {.output = pipe.writeEnd()}), "");
  std::byte one[1];
  EXPECT_THROW(pipe.read(one, [] { throw std::runtime_error("enough"); }), std::runtime_error);
}

TEST(OutputPipe, CanBeLeftWhileAProgramSaysMuch) {
  OutputPipe pipe;
  ChildProcess process;
  ASSERT_EQ(process.start({"cat", "/dev/zero"}, {.output = pipe.writeEnd()}), "");
  std::vector<std::byte> bytes(1 << 16);
  int calls = 0;
  const auto watch = [&calls] {
    if (++calls == 2) throw std::runtime_error("enough");
  };
  EXPECT_THROW(while (pipe.read(bytes, watch) > 0){}, std::runtime_error);
}

}  // namespace
}  // namespace tessera
