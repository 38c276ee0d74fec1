#include "base/threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

namespace tessera {
namespace {

TEST(ThreadPool, RunsEveryTaskOnceWithAThreadNumberInRange) {
  for (const int threads : {1, 2, 5}) {
    ThreadPool pool(threads);
    EXPECT_EQ(pool.threads(), threads);
    for (const size_t tasks : {size_t{0}, size_t{1}, size_t{3}, size_t{1000}}) {
      std::vector<std::atomic<int>> runs(tasks);
      std::atomic<bool> inRange{true};
      pool.run(tasks, [&](size_t task, int thread) {
        ++runs[task];
        if (thread < 0 || thread >= threads) inRange = false;
      });
      EXPECT_TRUE(inRange);
      for (const auto& count : runs) EXPECT_EQ(count, 1);
    }
  }
}

TEST(ThreadPool, SurvivesManyShortRounds) {
  ThreadPool pool(3);
  std::atomic<size_t> sum{0};
  for (int round = 0; round < 2000; ++round) {
    // In some rounds the workers or the caller wait long enough to go to sleep.
    const auto nap = [&](bool isDue) {
      if (isDue) std::this_thread::sleep_for(std::chrono::microseconds(300));
    };
    nap(round % 20 == 0);
    pool.run(4, [&](size_t task, int) {
      nap(task == 1 && round % 20 == 10);
      sum += task;
    });
  }
  EXPECT_EQ(sum, 2000u * 6u);
}

TEST(ThreadPool, RethrowsAndRemainsUsable) {
  for (const int threads : {1, 2}) {
    ThreadPool pool(threads);
    EXPECT_THROW(pool.run(10,
                          [](size_t task, int) {
                            if (task == 7) throw std::runtime_error("seven");
                          }),
                 std::runtime_error);
    std::atomic<int> count{0};
    pool.run(10, [&](size_t, int) { ++count; });
    EXPECT_EQ(count, 10);
  }
}

TEST(ThreadPool, CutsARangeIntoPiecesThatCoverItOnce) {
  ThreadPool pool(2);
  for (const size_t grain : {size_t{0}, size_t{1}, size_t{7}, size_t{100}, size_t{1000}}) {
    std::vector<std::atomic<int>> seen(100);
    pool.forRanges(100, grain, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) ++seen[i];
    });
    for (const auto& count : seen) EXPECT_EQ(count, 1);
  }
}

TEST(ThreadPool, UsesTheWholeMachineWhenAskedForZeroThreads) {
  EXPECT_GE(ThreadPool(0).threads(), 1);
}

}  // namespace
}  // namespace tessera
