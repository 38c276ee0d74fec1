// A small static thread pool. Work is cut into numbered tasks; which thread runs a task never changes a result,
// because a task's inputs and outputs depend on its number alone.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace tessera {

class ThreadPool {
 public:
  // Uses as many threads as the machine has where `threads` is 0. The calling thread is one of them.
  explicit ThreadPool(int threads = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const;

  // Runs body(task, thread) for task in [0, tasks), thread in [0, threads()), and returns when all are done. Rethrows
  // the first exception that a task threw. Must not be called from inside a task.
  void run(size_t tasks, const std::function<void(size_t task, int thread)>& body);

  // Runs body(begin, end) over [0, count) in ranges of `grain` elements.
  void forRanges(size_t count, size_t grain, const std::function<void(size_t begin, size_t end)>& body);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
