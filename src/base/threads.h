// A small static thread pool. Work is cut into numbered tasks; which thread runs a task never changes a result,
// because a task's inputs and outputs depend on its number alone.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace tessera {

class ThreadPool {
 public:
  // 0 threads: as many as the machine has. The calling thread is one of them.
  explicit ThreadPool(int threads = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int threads() const;

  // Runs body(task, thread) for task in [0, tasks), thread in [0, threads()), and returns when all are done. The first
  // exception is rethrown here. Not to be called from inside a task.
  void run(size_t tasks, const std::function<void(size_t task, int thread)>& body);

  // body(begin, end) over [0, count) in pieces of `grain`.
  void forRanges(size_t count, size_t grain, const std::function<void(size_t begin, size_t end)>& body);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
