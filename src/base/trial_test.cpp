#include "base/trial.h"

#include <gtest/gtest.h>
#include <signal.h>

#include <memory>

namespace tessera {
namespace {

TEST(Trial, ReturnsTheTextOfTheAttemptAndLeavesThisProcessAsItIs) {
  int changed = 0;
  EXPECT_EQ(tryInCopy([&] {
              changed = 1;
              return std::string();
            }),
            "");
  EXPECT_EQ(changed, 0);
  EXPECT_EQ(tryInCopy([] { return std::string("no such part"); }), "no such part");
  EXPECT_EQ(tryInCopy([] { return std::string(10'000, 'x'); }).size(), 4000u);
}

TEST(Trial, SaysHowTheCopyEnded) {
  EXPECT_NE(tryInCopy([]() -> std::string {
              ::raise(SIGSEGV);
              return "";
            }).find("ends with a fault"),
            std::string::npos);
  EXPECT_EQ(tryInCopy(
                []() -> std::string {
                  for (volatile unsigned i = 0;;) i = i + 1;
                },
                {.seconds = 1}),
            "it takes longer than 1 s");
}

TEST(Trial, LimitsTheMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers reserve the address space";
#endif
  const auto takeGigabyte = []() -> std::string {
    const auto memory = std::make_unique<char[]>(size_t{1} << 30);
    return memory[12345] == 0 ? "" : "not cleared";
  };
  EXPECT_EQ(tryInCopy(takeGigabyte), "");
  EXPECT_NE(tryInCopy(takeGigabyte, {.bytes = 64 << 20}).find("64 MiB of memory"), std::string::npos);
}

}  // namespace
}  // namespace tessera
