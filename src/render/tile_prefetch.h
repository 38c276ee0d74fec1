// Contents of tiles read in the background, for whoever must not wait: what is wanted is said again and again, and what
// is ready is taken.
#pragma once

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "base/check.h"

namespace tessera {

template <class Content>
class TilePrefetch {
 public:
  // `load` is called from threads of its own. At most `most` contents are read or wait at a time: they are in memory
  // beside what others count.
  TilePrefetch(std::function<Content(int tile)> load, int threads = 2, size_t most = 3)
      : load_(std::move(load)), most_(most) {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  }
  ~TilePrefetch() {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    changed_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }
  TilePrefetch(const TilePrefetch&) = delete;
  TilePrefetch& operator=(const TilePrefetch&) = delete;

  // The most urgent first. What was wanted before, and is no more, is forgotten.
  void want(std::vector<int> tiles) {
    {
      const std::lock_guard lock(mutex_);
      wanted_ = std::move(tiles);
      std::erase_if(parts_, [&](const auto& part) { return !part.second.isBeingRead && !isWanted(part.first); });
    }
    changed_.notify_all();
  }
  bool isReady(int tile) const {
    const std::lock_guard lock(mutex_);
    const auto found = parts_.find(tile);
    return found != parts_.end() && !found->second.isBeingRead;
  }
  // Of a tile that is ready, and is then wanted no more. Throws what `load` threw.
  Content take(int tile) {
    Part part;
    {
      const std::lock_guard lock(mutex_);
      const auto found = parts_.find(tile);
      CHECK((found != parts_.end() && !found->second.isBeingRead) == true);
      part = std::move(found->second);
      parts_.erase(found);
      std::erase(wanted_, tile);
    }
    changed_.notify_all();
    if (part.failure) std::rethrow_exception(part.failure);
    return std::move(part.content);
  }

 private:
  struct Part {
    bool isBeingRead = true;
    Content content;
    std::exception_ptr failure;
  };

  bool isWanted(int tile) const { return std::find(wanted_.begin(), wanted_.end(), tile) != wanted_.end(); }

  // The first that is wanted and nobody reads; -1: none, or there is no room.
  int next() const {
    if (parts_.size() >= most_) return -1;
    for (const int tile : wanted_) {
      if (!parts_.contains(tile)) return tile;
    }
    return -1;
  }

  void work() {
    std::unique_lock lock(mutex_);
    while (true) {
      changed_.wait(lock, [this] { return ends_ || next() >= 0; });
      if (ends_) return;
      const int tile = next();
      parts_[tile] = {};
      lock.unlock();
      Part part;
      part.isBeingRead = false;
      try {
        part.content = load_(tile);
      } catch (...) {
        part.failure = std::current_exception();
      }
      lock.lock();
      if (isWanted(tile)) {
        parts_[tile] = std::move(part);
      } else {
        parts_.erase(tile);
      }
      lock.unlock();
      changed_.notify_all();
      lock.lock();
    }
  }

  std::function<Content(int tile)> load_;
  size_t most_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> wanted_;
  std::map<int, Part> parts_;
  bool ends_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace tessera
