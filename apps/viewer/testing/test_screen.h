// For tests: starts a virtual screen (Xvfb), whatever other screens there are.
#pragma once

#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>

namespace tessera {

class TestScreen {
 public:
  TestScreen() {
    const char* display = std::getenv("DISPLAY");
    before_ = display ? display : "";
    int ends[2];
    if (pipe(ends) != 0) return;
    unsetenv("WAYLAND_DISPLAY");
    server_ = fork();
    if (server_ == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      close(ends[0]);
      const std::string number = std::to_string(ends[1]);
      // Without -noreset the server restarts whenever its last window closes, and refuses connections meanwhile.
      execlp("Xvfb", "Xvfb", "-displayfd", number.c_str(), "-screen", "0", "1600x1200x24", "-noreset", "-nolisten",
             "tcp", static_cast<char*>(nullptr));
      _exit(127);
    }
    close(ends[1]);
    std::string name = ":";  // of the display; the server writes its number once it accepts connections
    char c = 0;
    while (read(ends[0], &c, 1) == 1 && c != '\n') name += c;
    close(ends[0]);
    if (c != '\n') return;
    isThere_ = true;
    setenv("DISPLAY", name.c_str(), 1);
  }
  ~TestScreen() {
    if (server_ > 0) {
      kill(server_, SIGTERM);
      waitpid(server_, nullptr, 0);
    }
    if (before_.empty()) {
      unsetenv("DISPLAY");
    } else {
      setenv("DISPLAY", before_.c_str(), 1);
    }
  }
  TestScreen(const TestScreen&) = delete;
  TestScreen& operator=(const TestScreen&) = delete;

  bool isThere() const { return isThere_; }

 private:
  std::string before_;
  pid_t server_ = -1;
  bool isThere_ = false;
};

}  // namespace tessera
