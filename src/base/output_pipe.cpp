#include "base/output_pipe.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kBetweenWatches{200};

}  // namespace

OutputPipe::OutputPipe() : lastWatch_(std::chrono::steady_clock::now()) {
  int ends[2] = {-1, -1};
  if (::pipe2(ends, O_CLOEXEC) != 0)
    throw Error("a pipe", "", std::strerror(errno), "close other programs and try again");
  readEnd_.reset(ends[0]);
  writeEnd_.reset(ends[1]);
  // Fewer changes between the two processes; smaller where the system does not allow it.
  constexpr int kBytes = 1 << 20;
  ::fcntl(readEnd_.get(), F_SETPIPE_SZ, kBytes);
}

size_t OutputPipe::read(std::span<std::byte> bytes, const std::function<void()>& watch) {
  writeEnd_.close();
  size_t done = 0;
  while (done < bytes.size()) {
    const auto now = std::chrono::steady_clock::now();
    if (watch && now - lastWatch_ >= kBetweenWatches) {
      lastWatch_ = now;
      watch();
    }
    pollfd ready{readEnd_.get(), POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(kBetweenWatches.count())) <= 0) continue;
    const ssize_t count = ::read(readEnd_.get(), bytes.data() + done, bytes.size() - done);
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count <= 0) break;
    done += static_cast<size_t>(count);
  }
  return done;
}

std::string OutputPipe::readText(size_t maxBytes, const std::function<void()>& watch) {
  constexpr size_t kBytesAtOnce = 1 << 14;
  std::string text;
  while (text.size() < maxBytes) {
    const size_t before = text.size();
    text.resize(std::min(maxBytes, before + kBytesAtOnce));
    const size_t count = read(std::as_writable_bytes(std::span(text).subspan(before)), watch);
    text.resize(before + count);
    if (count == 0) break;
  }
  return text;
}

}  // namespace tessera
