// Compresses text files with gzip on a separate thread, once for all concurrent requests of the same file, and caches
// the results.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "serve/site_file.h"

namespace tessera {

class Compressor {
 public:
  using Body = std::shared_ptr<const std::string>;
  using Done = std::function<void(Body)>;

  // Caches the most recently used results, up to `maxBytes`.
  explicit Compressor(size_t maxBytes);
  // Finishes the file that is being compressed; the callbacks of files still in the queue are never called.
  ~Compressor();

  // Calls `done` once, with the whole file compressed, or with null if the file has been truncated. The call is made
  // immediately if the result is cached, otherwise later, from the compressor's thread.
  void compress(const std::shared_ptr<const SiteFile>& file, Done done);
  size_t bytes() const;  // of the cache

 private:
  struct Kept {
    std::string key;
    Body body;
    size_t bytes() const { return sizeof(Kept) + key.capacity() + body->capacity(); }
  };
  void work();
  void keep(const std::string& key, const Body& body);

  const size_t maxBytes_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<const SiteFile>> queue_;
  std::map<std::string, std::vector<Done>> waiting_;
  std::list<Kept> kept_;  // least recently used first
  std::map<std::string, std::list<Kept>::iterator> places_;
  size_t bytes_ = 0;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace tessera
