#include "eval/video.h"

#include <fmt/format.h>
#include <sys/socket.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "base/check.h"
#include "base/child_process.h"
#include "base/error.h"
#include "base/leftovers.h"

namespace tessera {
namespace {

std::vector<std::string> argumentsFor(const VideoOptions& options, const fs::path& target) {
  return {options.program, "-nostdin", "-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt",
          "rgb24", "-video_size", fmt::format("{}x{}", options.width, options.height), "-framerate",
          fmt::format("{}", options.framesPerSecond), "-i", "pipe:0", "-vf",
          "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv,format=yuv420p", "-colorspace",
          "bt709", "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-c:v", "libx264", "-crf",
          fmt::format("{}", options.quality), "-movflags", "+faststart",
          // With "file:" and an absolute path, no name can be mistaken for an option or a protocol.
          "-f", "mp4", "file:" + fs::absolute(target).string()};
}

}  // namespace

struct VideoWriter::State {
  fs::path path, partial;
  VideoOptions options;
  ChildProcess process;
  Descriptor frames;  // a socket, because writing to a pipe of a program that died would raise SIGPIPE

  void removePartial() const {
    std::error_code ignored;
    fs::remove(partial, ignored);
  }

  [[noreturn]] void fail() {
    frames.close();
    if (process.isRunning()) process.wait();
    removePartial();
    const std::string words = process.lastWords();
    throw Error(path.string(), "", options.program + " failed" + (words.empty() ? "" : ": " + words),
                "check that it can encode H.264 (libx264), and the free space");
  }
};

VideoWriter::VideoWriter(fs::path path, const VideoOptions& options) : state_(std::make_unique<State>()) {
  CHECK(options.width >= 1);
  CHECK(options.height >= 1);
  State& state = *state_;
  state.path = std::move(path);
  state.options = options;
  state.partial = partialPlace(state.path);
  std::error_code status;
  if (fs::is_directory(state.path, status))
    throw Error(state.path.string(), "", "is a folder, not a file", "name a file to write, or remove the folder");
  if (state.path.has_parent_path()) fs::create_directories(state.path.parent_path(), status);
  removeLeftovers(state.path);

  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    throw Error(options.program, "", std::strerror(errno), "close other programs and try again");
  }
  state.frames.reset(ends[0]);
  const Descriptor theirs(ends[1]);

  const std::string failure = state.process.start(argumentsFor(options, state.partial), {.input = theirs.get()});
  if (failure.empty()) return;
  throw Error(options.program, "", "the program that encodes video cannot be started: " + failure,
              "install it (apt-get install ffmpeg), or render to a folder of PNGs");
}

VideoWriter::~VideoWriter() {
  if (!state_->process.isRunning()) return;
  state_->process.kill();
  state_->removePartial();
}

void VideoWriter::add(const ImageU8& frame) {
  State& state = *state_;
  CHECK(frame.width == state.options.width);
  CHECK(frame.height == state.options.height);
  CHECK(frame.channels == 3);
  size_t sent = 0;
  while (sent < frame.pixels.size()) {
    const ssize_t count =
        ::send(state.frames.get(), frame.pixels.data() + sent, frame.pixels.size() - sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) state.fail();
    sent += static_cast<size_t>(count);
  }
}

void VideoWriter::finish() {
  State& state = *state_;
  CHECK(state.process.isRunning());
  state.frames.close();
  const bool succeeded = state.process.wait().empty();
  std::error_code unreadable;
  if (!succeeded || fs::file_size(state.partial, unreadable) == 0 || unreadable) {
    state.fail();
  }
  std::error_code failure;
  fs::rename(state.partial, state.path, failure);
  if (failure) {
    throw Error(state.path.string(), "", "could not be written: " + failure.message(),
                "rename " + state.partial.string() + ", which is complete, before you render again");
  }
}

}  // namespace tessera
