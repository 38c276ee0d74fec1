// For tests: runs the built `tessera` with an argument vector, without a shell, and captures its output.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "base/file.h"

extern char** environ;

namespace tessera {

struct Said {
  int exitCode = -1;  // 128 + signal when it was killed
  std::string out, err;
};

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

class Program {
 public:
  Program(const fs::path& folder, const std::vector<std::string>& arguments) {
    static int count = 0;
    out_ = folder / ("out-" + std::to_string(count));
    err_ = folder / ("err-" + std::to_string(count++));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 1, out_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_addopen(&actions, 2, err_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    std::vector<std::string> words = {TESSERA_PROGRAM};
    words.insert(words.end(), arguments.begin(), arguments.end());
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    const int failed = posix_spawn(&process_, TESSERA_PROGRAM, &actions, nullptr, pointers.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    EXPECT_EQ(failed, 0) << TESSERA_PROGRAM;
  }
  ~Program() {
    if (process_ <= 0) return;
    kill(SIGKILL);
    wait();
  }
  Program(const Program&) = delete;

  void kill(int signal) { ::kill(process_, signal); }

  // Returns whether the process has ended.
  bool ended() {
    siginfo_t info{};
    return waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
           info.si_pid == process_;
  }

  // Returns its standard output so far.
  std::string said() const { return readTextFile(out_); }

  Said wait() {
    int status = 0;
    EXPECT_EQ(waitpid(process_, &status, 0), process_);
    process_ = -1;
    Said said{WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), readTextFile(out_), readTextFile(err_)};
    fs::remove(out_);
    fs::remove(err_);
    return said;
  }

 private:
  fs::path out_, err_;
  pid_t process_ = -1;
};

// Returns whether a program of that name can be started.
inline bool isInPath(const std::string& name) {
  const char* search = std::getenv("PATH");
  std::stringstream folders(search == nullptr ? "" : search);
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (::access((folder + "/" + name).c_str(), X_OK) == 0) return true;
  }
  return false;
}

// Waits until the condition holds or the program has ended.
template <class Condition>
void waitUntil(Program& program, const Condition& isSo) {
  while (!isSo() && !program.ended()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
}
inline void waitForFile(Program& program, const fs::path& file) {
  waitUntil(program, [&] { return fs::exists(file); });
}

// Returns the step of a model's last checkpoint; -1 if there is none.
inline int64_t readLastStep(const fs::path& model) {
  const fs::path manifest = model / "manifest.json";
  return fs::exists(manifest) ? nlohmann::json::parse(readTextFile(manifest)).at("step").get<int64_t>() : -1;
}

}  // namespace tessera
