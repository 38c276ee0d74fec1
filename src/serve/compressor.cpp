#include "serve/compressor.h"

#include <zlib.h>

#include <algorithm>
#include <array>

namespace tessera {
namespace {

std::string cacheKey(const SiteFile& file) {
  return file.path().string() + file.tag();
}

Compressor::Body gzipped(const SiteFile& file) {
  z_stream stream{};
  if (deflateInit2(&stream, 6, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY) != Z_OK) return nullptr;  // + 16: gzip
  std::array<char, size_t{1} << 15> in, out;
  std::string compressed;
  bool isComplete = true;
  for (uint64_t begin = 0; isComplete && begin < file.bytes();) {
    const size_t bytes = std::min<uint64_t>(in.size(), file.bytes() - begin);
    isComplete = file.read(begin, std::span(in).first(bytes));
    begin += bytes;
    stream.next_in = reinterpret_cast<Bytef*>(in.data());
    stream.avail_in = static_cast<uInt>(bytes);
    do {
      stream.next_out = reinterpret_cast<Bytef*>(out.data());
      stream.avail_out = static_cast<uInt>(out.size());
      deflate(&stream, begin < file.bytes() ? Z_NO_FLUSH : Z_FINISH);
      compressed.append(out.data(), out.size() - stream.avail_out);
    } while (stream.avail_out == 0);
  }
  deflateEnd(&stream);
  compressed.shrink_to_fit();
  return isComplete ? std::make_shared<const std::string>(std::move(compressed)) : nullptr;
}

}  // namespace

Compressor::Compressor(size_t maxBytes) : maxBytes_(maxBytes), thread_([this] { work(); }) {}

Compressor::~Compressor() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void Compressor::compress(const std::shared_ptr<const SiteFile>& file, Done done) {
  std::string key = cacheKey(*file);
  Body body;
  {
    const std::lock_guard lock(mutex_);
    const auto place = places_.find(key);
    if (place == places_.end()) {
      auto& waiting = waiting_[std::move(key)];
      waiting.push_back(std::move(done));
      if (waiting.size() > 1) return;
      queue_.push_back(file);
    } else {
      kept_.splice(kept_.end(), kept_, place->second);
      body = place->second->body;
    }
  }
  if (body) return done(body);
  changed_.notify_one();
}

size_t Compressor::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

void Compressor::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return ended_ || !queue_.empty(); });
    if (ended_) return;
    const auto file = std::move(queue_.front());
    queue_.pop_front();
    lock.unlock();
    const std::string key = cacheKey(*file);
    const Body body = gzipped(*file);
    lock.lock();
    auto waiting = waiting_.extract(key);
    if (body) keep(key, body);
    lock.unlock();
    for (Done& done : waiting.mapped()) done(body);
    lock.lock();
  }
}

void Compressor::keep(const std::string& key, const Body& body) {
  const Kept entry{key, body};
  if (entry.bytes() > maxBytes_) return;
  bytes_ += entry.bytes();
  places_[key] = kept_.insert(kept_.end(), entry);
  while (bytes_ > maxBytes_) {
    bytes_ -= kept_.front().bytes();
    places_.erase(kept_.front().key);
    kept_.pop_front();
  }
}

}  // namespace tessera
