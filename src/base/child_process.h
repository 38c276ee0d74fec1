// A program that runs beside this one, never through a shell: its arguments are passed as they are. It is killed when
// the thread that started it ends, whatever ends it: no program is left behind.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <vector>

#include "base/file.h"

namespace tessera {

// A file descriptor, closed at the end.
class Descriptor {
 public:
  Descriptor() = default;
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  void reset(int value);
  void close();
  int get() const { return value_; }

 private:
  int value_ = -1;
};

struct ChildOptions {
  int input = -1;  // a descriptor that it reads as its standard input; -1: it has none
  // A file to which its standard output and error output are appended, in a folder that is created if it is missing;
  // empty: they are kept in memory.
  fs::path log;
  int output = -1;           // a descriptor that its standard output is written to instead (output_pipe.h)
  bool hasOwnGroup = false;  // Ctrl-C on a terminal does not reach it; `interrupt` does
};

class ChildProcess {
 public:
  ChildProcess() = default;
  ~ChildProcess() { kill(); }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // Starts the program arguments[0], which is looked up in PATH. Returns an empty text, or why it cannot be started.
  // Throws Error naming the log if it cannot be written.
  std::string start(std::vector<std::string> arguments, const ChildOptions& options = {});
  bool isRunning() const { return process_ > 0; }  // started, and wait was not called
  // Waits for its end, at most for so long. Returns whether it has ended; then `wait` says how.
  bool waitFor(double seconds);
  // Waits for its end. Returns an empty text if it reported success, else how it ended.
  std::string wait();
  void interrupt();  // sends SIGINT
  void kill();
  // The end of what this run of it wrote to its standard output and error output.
  std::string lastWords(size_t bytes = 400) const;
  // How it ended, after `wait`: the signal that ended it, or 0, and the status that it returned, or 0.
  int signal() const;
  int status() const;

 private:
  pid_t process_ = -1;
  bool ended_ = false;
  int status_ = 0;
  bool hasOwnGroup_ = false;
  int64_t before_ = 0;   // bytes of the log that others wrote
  Descriptor messages_;  // a memory file, or the log
};

// Returns the largest resident size in bytes of the child processes, and of programs that they ran themselves, that
// ended since this was called before, killed ones, too.
int64_t takePeakOfChildren();

}  // namespace tessera
