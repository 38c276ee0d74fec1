#include "base/threads.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace tessera {
namespace {

// Tasks often take a fraction of a millisecond, and waking a thread takes as long as some of them: a waiting thread
// spins for this long before it sleeps.
constexpr std::chrono::microseconds kPatience{50};

template <class Condition>
void waitAwake(const Condition& condition) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (!condition() && std::chrono::steady_clock::now() < until) {
    for (int i = 0; i < 16 && !condition(); ++i) {
#if defined(__x86_64__)
      __builtin_ia32_pause();
#endif
    }
  }
}

}  // namespace

struct ThreadPool::State {
  std::vector<std::thread> workers;
  std::mutex mutex;
  std::condition_variable wake, done;
  const std::function<void(size_t, int)>* body = nullptr;
  size_t tasks = 0;
  std::atomic<size_t> next{0};
  std::atomic<size_t> generation{0};
  std::atomic<int> busy{0};
  std::atomic<bool> stopping{false};
  std::exception_ptr failure;

  void work(int thread) {
    for (;;) {
      const size_t task = next.fetch_add(1, std::memory_order_relaxed);
      if (task >= tasks) return;
      try {
        (*body)(task, thread);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!failure) failure = std::current_exception();
      }
    }
  }

  void loop(int thread) {
    size_t seen = 0;
    for (;;) {
      waitAwake([&] { return stopping || generation != seen; });
      {
        std::unique_lock lock(mutex);
        wake.wait(lock, [&] { return stopping || generation != seen; });
        if (stopping) return;
        seen = generation;
      }
      work(thread);
      const std::lock_guard lock(mutex);
      if (--busy == 0) done.notify_one();
    }
  }
};

ThreadPool::ThreadPool(int threads) : state_(std::make_unique<State>()) {
  if (threads <= 0) threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  for (int i = 1; i < threads; ++i) state_->workers.emplace_back([this, i] { state_->loop(i); });
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(state_->mutex);
    state_->stopping = true;
  }
  state_->wake.notify_all();
  for (std::thread& worker : state_->workers) worker.join();
}

int ThreadPool::threads() const {
  return static_cast<int>(state_->workers.size()) + 1;
}

void ThreadPool::run(size_t tasks, const std::function<void(size_t, int)>& body) {
  if (tasks == 0) return;
  State& state = *state_;
  if (tasks == 1 || state.workers.empty()) {
    for (size_t task = 0; task < tasks; ++task) body(task, 0);
    return;
  }
  {
    const std::lock_guard lock(state.mutex);
    state.body = &body;
    state.tasks = tasks;
    state.next.store(0, std::memory_order_relaxed);
    state.busy = static_cast<int>(state.workers.size());
    state.failure = nullptr;
    ++state.generation;
  }
  state.wake.notify_all();
  state.work(0);
  waitAwake([&] { return state.busy == 0; });
  std::unique_lock lock(state.mutex);
  state.done.wait(lock, [&] { return state.busy == 0; });
  if (state.failure) std::rethrow_exception(state.failure);
}

void ThreadPool::forRanges(size_t count, size_t grain, const std::function<void(size_t, size_t)>& body) {
  grain = std::max<size_t>(grain, 1);
  run((count + grain - 1) / grain, [&](size_t task, int) { body(task * grain, std::min(count, (task + 1) * grain)); });
}

}  // namespace tessera
