#include "base/trial.h"

#include <fmt/format.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "base/child_process.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TESSERA_SANITIZED 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define TESSERA_SANITIZED 1
#endif
#endif

namespace tessera {
namespace {

constexpr size_t kLongestText = 4000;
constexpr int kFailed = 1, kFailedWithoutText = 2;

// Returns the address space that this process uses, in bytes.
uint64_t addressSpace() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

void limitCopy(const TrialLimits& limits, uint64_t space) {
  const auto limit = [](int resource, uint64_t soft, uint64_t hard) {
    const rlimit value = {soft, hard};
    ::setrlimit(static_cast<__rlimit_resource>(resource), &value);
  };
  limit(RLIMIT_CORE, 0, 0);
  limit(RLIMIT_CPU, static_cast<uint64_t>(limits.seconds), static_cast<uint64_t>(limits.seconds) + 1);
#ifndef TESSERA_SANITIZED
  if (space > 0) limit(RLIMIT_AS, space + limits.bytes, space + limits.bytes);
#else
  (void)space;
#endif
  for (const int fault : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGALRM, SIGINT, SIGTERM})
    ::signal(fault, SIG_DFL);
  ::alarm(2 * static_cast<unsigned>(limits.seconds));  // it may wait for what another thread held at the fork
}

}  // namespace

std::string tryInCopy(const std::function<std::string()>& attempt, const TrialLimits& limits) {
  Descriptor text;
  text.reset(::memfd_create("text", MFD_CLOEXEC));
  const uint64_t space = addressSpace();
  const pid_t copy = text.get() < 0 ? -1 : ::fork();
  if (copy < 0) return fmt::format("there is no room for a copy of this process: {}", std::strerror(errno));
  if (copy == 0) {
    limitCopy(limits, space);
    int status = 0;
    try {
      const std::string failure = attempt().substr(0, kLongestText);
      if (!failure.empty()) status = kFailed;
      if (::pwrite(text.get(), failure.data(), failure.size(), 0) < 0) status = kFailedWithoutText;
    } catch (...) {
      status = kFailedWithoutText;
    }
    ::_exit(status);
  }
  int status = 0;
  pid_t ended = -1;
  do {
    ended = ::waitpid(copy, &status, 0);
  } while (ended < 0 && errno == EINTR);
  if (ended != copy) return fmt::format("how it ended is not known: {}", std::strerror(errno));
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGXCPU || signal == SIGALRM) return fmt::format("it takes longer than {} s", limits.seconds);
    if (signal == SIGKILL) return "it takes too long, or more memory than there is";
    return fmt::format("it ends with a fault ({})", ::strsignal(signal));
  }
  const int code = WEXITSTATUS(status);
  if (code == 0) return "";
  std::string failure(kLongestText, '\0');
  const ssize_t length = ::pread(text.get(), failure.data(), failure.size(), 0);
  failure.resize(static_cast<size_t>(std::max<ssize_t>(length, 0)));
  if (code == kFailed && !failure.empty()) return failure;
  return fmt::format("it takes more than {} MiB of memory, or ends with a fault", limits.bytes >> 20);
}

}  // namespace tessera
