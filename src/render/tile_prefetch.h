// Reads tile contents in background threads, for callers that must not block: the caller states repeatedly which tiles
// it requests and takes those that are ready.
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
  // `load` is called from `threads` worker threads. At most `maximum` contents are being read or waiting to be taken at
  // a time; their memory is not part of any cache's budget.
  TilePrefetch(std::function<Content(int tile)> load, int threads = 2, size_t maximum = 3)
      : load_(std::move(load)), max_(maximum) {
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

  // Replaces the requested tiles, the most urgent first. Contents of tiles that are no longer requested are dropped.
  void request(std::vector<int> tiles) {
    {
      const std::lock_guard lock(mutex_);
      requested_ = std::move(tiles);
      std::erase_if(parts_, [&](const auto& part) { return !part.second.isBeingRead && !isRequested(part.first); });
    }
    changed_.notify_all();
  }
  bool isReady(int tile) const {
    const std::lock_guard lock(mutex_);
    const auto it = parts_.find(tile);
    return it != parts_.end() && !it->second.isBeingRead;
  }
  // Returns the content of a tile that is ready and removes the tile from the requested ones. Rethrows what `load`
  // threw.
  Content take(int tile) {
    Part part;
    {
      const std::lock_guard lock(mutex_);
      const auto it = parts_.find(tile);
      CHECK((it != parts_.end() && !it->second.isBeingRead) == true);
      part = std::move(it->second);
      parts_.erase(it);
      std::erase(requested_, tile);
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

  bool isRequested(int tile) const { return std::find(requested_.begin(), requested_.end(), tile) != requested_.end(); }

  // Returns the first requested tile that no thread reads yet; -1 if there is none or the capacity is exhausted.
  int next() const {
    if (parts_.size() >= max_) return -1;
    for (const int tile : requested_) {
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
      if (isRequested(tile)) {
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
  size_t max_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<int> requested_;
  std::map<int, Part> parts_;
  bool ends_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace tessera
