#include "eval/video.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <vector>

#include "base/check.h"
#include "base/error.h"

extern char** environ;

namespace tessera {
namespace {

class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  void reset(int value) {
    close();
    value_ = value;
  }
  void close() {
    if (value_ >= 0) ::close(value_);
    value_ = -1;
  }
  int get() const { return value_; }

 private:
  int value_ = -1;
};

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
  pid_t process = -1;
  Descriptor frames;    // a socket, because writing to a pipe of a program that died would raise SIGPIPE
  Descriptor messages;  // the output of the program, in a memory file

  std::string lastWords() const {
    char text[400];
    const off_t size = ::lseek(messages.get(), 0, SEEK_END);
    const off_t from = std::max<off_t>(0, size - static_cast<off_t>(sizeof text));
    const ssize_t count = ::pread(messages.get(), text, sizeof text, from);
    std::string words(text, count > 0 ? static_cast<size_t>(count) : 0);
    while (!words.empty() && std::isspace(static_cast<unsigned char>(words.back()))) words.pop_back();
    return words;
  }

  int wait() {
    int status = 0;
    while (::waitpid(process, &status, 0) < 0 && errno == EINTR) {
    }
    process = -1;
    return status;
  }

  void removePartial() const {
    std::error_code ignored;
    fs::remove(partial, ignored);
  }

  [[noreturn]] void fail() {
    frames.close();
    if (process > 0) wait();
    removePartial();
    const std::string words = lastWords();
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
  state.partial = state.path;
  state.partial += ".partial-" + std::to_string(::getpid());
  std::error_code status;
  if (state.path.has_parent_path()) fs::create_directories(state.path.parent_path(), status);

  int ends[2];
  state.messages.reset(::memfd_create("ffmpeg messages", MFD_CLOEXEC));
  if (state.messages.get() < 0 || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    throw Error(options.program, "", std::strerror(errno), "close other programs and try again");
  }
  state.frames.reset(ends[0]);
  const Descriptor theirs(ends[1]);

  std::vector<std::string> arguments = argumentsFor(options, state.partial);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, theirs.get(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, state.messages.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, state.messages.get(), STDERR_FILENO);
  const int failure =
      ::posix_spawnp(&state.process, options.program.c_str(), &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failure != 0) {
    state.process = -1;
    throw Error(options.program, "",
                std::string("the program that encodes video cannot be started: ") + std::strerror(failure),
                "install it (apt-get install ffmpeg), or render to a folder of PNGs");
  }
}

VideoWriter::~VideoWriter() {
  if (state_->process <= 0) return;
  ::kill(state_->process, SIGKILL);
  state_->wait();
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
  CHECK(state.process > 0);
  state.frames.close();
  const int status = state.wait();
  std::error_code unreadable;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || fs::file_size(state.partial, unreadable) == 0 || unreadable) {
    state.fail();
  }
  std::error_code failure;
  fs::rename(state.partial, state.path, failure);
  if (failure) {
    state.removePartial();
    throw Error(state.path.string(), "", "could not be written: " + failure.message(),
                "check the path and its permissions");
  }
}

}  // namespace tessera
