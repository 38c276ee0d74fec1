// Files of text, gzipped on a thread of their own: once for all who ask at the same time.
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

  // Keeps what was asked for last, up to so many bytes.
  explicit Compressor(size_t mostBytes);
  // Ends the file that is being compressed; who waits for another hears nothing any more.
  ~Compressor();

  // Calls `done` once, with all of the file, gzipped, or with nothing where it has been cut off: at once where that is
  // kept, otherwise later, from the compressor's thread.
  void compress(const std::shared_ptr<const SiteFile>& file, Done done);
  size_t bytes() const;  // kept

 private:
  struct Kept {
    std::string key;
    Body body;
    size_t bytes() const { return sizeof(Kept) + key.capacity() + body->capacity(); }
  };
  void work();
  void keep(const std::string& key, const Body& body);

  const size_t mostBytes_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::shared_ptr<const SiteFile>> queue_;
  std::map<std::string, std::vector<Done>> waiting_;
  std::list<Kept> kept_;  // that was asked for longest ago first
  std::map<std::string, std::list<Kept>::iterator> places_;
  size_t bytes_ = 0;
  bool ended_ = false;
  std::thread thread_;
};

}  // namespace tessera
