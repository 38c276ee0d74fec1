#include "base/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <thread>

#include "base/check.h"
#include "base/error.h"

namespace tessera {
namespace {

constexpr int kUnknownEnd = 1 << 8;  // of a program that something else has waited for: status 1

std::atomic<int64_t> peakOfChildren = 0;

void recordPeak(const rusage& usage) {
  const int64_t bytes = int64_t{usage.ru_maxrss} << 10;
  for (int64_t largest = peakOfChildren; bytes > largest && !peakOfChildren.compare_exchange_weak(largest, bytes);) {
  }
}

}  // namespace

void Descriptor::reset(int value) {
  close();
  value_ = value;
}

void Descriptor::close() {
  if (value_ >= 0) ::close(value_);
  value_ = -1;
}

std::string ChildProcess::start(std::vector<std::string> arguments, const ChildOptions& options) {
  CHECK(!arguments.empty());
  CHECK(!isRunning());
  if (options.log.empty()) {
    messages_.reset(::memfd_create("messages", MFD_CLOEXEC));
  } else {
    std::error_code ignored;
    fs::create_directories(options.log.parent_path(), ignored);
    messages_.reset(::open(options.log.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
    if (messages_.get() < 0)
      throw Error(options.log.string(), "", std::string("cannot be written: ") + std::strerror(errno),
                  "check free space and permissions");
  }
  if (messages_.get() < 0) return std::strerror(errno);
  before_ = std::max<off_t>(::lseek(messages_.get(), 0, SEEK_END), 0);
  hasOwnGroup_ = options.hasOwnGroup;
  Descriptor nothing;
  if (options.input < 0) nothing.reset(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  const int input = options.input < 0 ? nothing.get() : options.input;
  const int output = options.output < 0 ? messages_.get() : options.output;
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  int ends[2] = {-1, -1};
  if (::pipe2(ends, O_CLOEXEC) != 0) return std::strerror(errno);
  Descriptor failureOut(ends[0]), failureIn(ends[1]);

  const pid_t parent = ::getpid(), process = ::fork();
  if (process < 0) return std::strerror(errno);
  if (process == 0) {
    // Other threads do not exist here and may have held any lock: only system calls.
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::signal(SIGPIPE, SIG_DFL);  // this program may ignore it
    if (options.hasOwnGroup) ::setpgid(0, 0);
    if (::getppid() == parent && ::dup2(input, STDIN_FILENO) >= 0 && ::dup2(output, STDOUT_FILENO) >= 0 &&
        ::dup2(messages_.get(), STDERR_FILENO) >= 0) {
      ::execvp(pointers[0], pointers.data());
    }
    const int failure = errno;
    [[maybe_unused]] const ssize_t written = ::write(failureIn.get(), &failure, sizeof failure);
    ::_exit(127);
  }
  failureIn.close();
  process_ = process;
  ended_ = false;
  int failure = 0;
  ssize_t count = 0;
  while ((count = ::read(failureOut.get(), &failure, sizeof failure)) < 0 && errno == EINTR) {
  }
  if (count != sizeof failure) return "";
  wait();
  return std::strerror(failure);
}

bool ChildProcess::waitFor(double seconds) {
  CHECK(isRunning());
  using std::chrono::steady_clock;
  const auto end = steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!ended_) {
    rusage usage{};
    const pid_t ended = ::wait4(process_, &status_, WNOHANG, &usage);
    if (ended < 0 && errno != EINTR) status_ = kUnknownEnd;
    ended_ = ended == process_ || (ended < 0 && errno != EINTR);
    if (ended_) recordPeak(usage);
    if (ended_ || steady_clock::now() >= end) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return ended_;
}

std::string ChildProcess::wait() {
  CHECK(isRunning());
  if (!ended_) {
    rusage usage{};
    pid_t ended = -1;
    while ((ended = ::wait4(process_, &status_, 0, &usage)) < 0 && errno == EINTR) {
    }
    if (ended < 0) status_ = kUnknownEnd;
    recordPeak(usage);
  }
  process_ = -1;
  ended_ = false;
  if (signal() != 0) return fmt::format("was ended by signal {}", signal());
  return status() == 0 ? "" : fmt::format("ended with status {}", status());
}

int ChildProcess::signal() const {
  CHECK(!isRunning());
  return WIFSIGNALED(status_) ? WTERMSIG(status_) : 0;
}

int ChildProcess::status() const {
  CHECK(!isRunning());
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : 0;
}

int64_t takePeakOfChildren() {
  return peakOfChildren.exchange(0);
}

void ChildProcess::interrupt() {
  if (isRunning() && !ended_) ::kill(hasOwnGroup_ ? -process_ : process_, SIGINT);
}

void ChildProcess::kill() {
  if (!isRunning()) return;
  if (!ended_) ::kill(hasOwnGroup_ ? -process_ : process_, SIGKILL);
  wait();
}

std::string ChildProcess::lastWords(size_t bytes) const {
  const off_t size = ::lseek(messages_.get(), 0, SEEK_END);
  std::string words(std::min(bytes, static_cast<size_t>(std::max<off_t>(size - before_, 0))), '\0');
  const ssize_t count = ::pread(messages_.get(), words.data(), words.size(), size - static_cast<off_t>(words.size()));
  words.resize(count > 0 ? static_cast<size_t>(count) : 0);
  while (!words.empty() && std::isspace(static_cast<unsigned char>(words.back()))) words.pop_back();
  return words;
}

}  // namespace tessera
