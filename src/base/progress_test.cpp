#include "base/progress.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "base/memory.h"

namespace tessera {
namespace {

// GoogleTest captures stderr in a file, which is not a terminal.
TEST(Progress, WritesPlainLinesWhereThereIsNoTerminal) {
  testing::internal::CaptureStderr();
  {
    Progress progress("train", 10, "steps");
    for (int step = 0; step <= 10; ++step) progress.update(step, "20.0 dB");
    progress.finish("27.3 dB");
    progress.finish("again");
  }
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;  // the updates were more frequent than lines
  EXPECT_EQ(text.find('\r'), std::string::npos);
  EXPECT_EQ(text.find('\x1b'), std::string::npos);
  EXPECT_NE(text.find("train: 100 % (10/10 steps)"), std::string::npos) << text;
  EXPECT_NE(text.find("27.3 dB\n"), std::string::npos) << text;
}

TEST(Progress, CountsWithoutATotal) {
  testing::internal::CaptureStderr();
  Progress progress("read", 0, "photos");
  progress.update(7);
  progress.finish();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("read: 7 photos"), std::string::npos) << text;
  EXPECT_EQ(text.find('%'), std::string::npos) << text;
}

TEST(Progress, NeverShowsMoreThanTheWhole) {
  testing::internal::CaptureStderr();
  Progress progress("x", 10, "steps");
  progress.update(25);
  progress.finish();
  EXPECT_NE(testing::internal::GetCapturedStderr().find("100 %"), std::string::npos);
}

TEST(Memory, SeesAnAllocationThatIsTouched) {
  const int64_t before = residentBytes();
  ASSERT_GT(before, 0);
  constexpr size_t kBytes = size_t{64} << 20;
  {
    std::vector<char> block(kBytes, 1);
    EXPECT_GE(residentBytes(), before + static_cast<int64_t>(kBytes) / 2);
    EXPECT_EQ(block[kBytes / 2], 1);
  }
  EXPECT_GE(peakResidentBytes(), before + static_cast<int64_t>(kBytes) / 2);
}

}  // namespace
}  // namespace tessera
