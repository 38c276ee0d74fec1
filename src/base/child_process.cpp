#include "base/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>

#include "base/check.h"

extern char** environ;

namespace tessera {

void Descriptor::reset(int value) {
  close();
  value_ = value;
}

void Descriptor::close() {
  if (value_ >= 0) ::close(value_);
  value_ = -1;
}

std::string ChildProcess::start(std::vector<std::string> arguments, int input) {
  CHECK(!arguments.empty());
  CHECK(!isRunning());
  messages_.reset(::memfd_create("messages", MFD_CLOEXEC));
  if (messages_.get() < 0) return std::strerror(errno);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (input >= 0) {
    posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  } else {
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  }
  posix_spawn_file_actions_adddup2(&actions, messages_.get(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, messages_.get(), STDERR_FILENO);
  const int failure = ::posix_spawnp(&process_, pointers[0], &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failure == 0) return "";
  process_ = -1;
  return std::strerror(failure);
}

std::string ChildProcess::wait() {
  CHECK(isRunning());
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  if (WIFSIGNALED(status)) return fmt::format("was ended by signal {}", WTERMSIG(status));
  if (!WIFEXITED(status) || WEXITSTATUS(status) == 0) return "";
  return fmt::format("ended with status {}", WEXITSTATUS(status));
}

void ChildProcess::kill() {
  if (!isRunning()) return;
  ::kill(process_, SIGKILL);
  wait();
}

std::string ChildProcess::lastWords() const {
  char text[400];
  const off_t size = ::lseek(messages_.get(), 0, SEEK_END);
  const off_t from = std::max<off_t>(0, size - static_cast<off_t>(sizeof text));
  const ssize_t count = ::pread(messages_.get(), text, sizeof text, from);
  std::string words(text, count > 0 ? static_cast<size_t>(count) : 0);
  while (!words.empty() && std::isspace(static_cast<unsigned char>(words.back()))) words.pop_back();
  return words;
}

}  // namespace tessera
