// A program that runs beside this one, never through a shell: its arguments are passed as they are.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

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

class ChildProcess {
 public:
  ChildProcess() = default;
  ~ChildProcess() { kill(); }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  // Starts the program arguments[0], which is looked up in PATH. `input`: a descriptor that it reads as its standard
  // input; -1: it has none. Returns an empty text, or why the program cannot be started.
  std::string start(std::vector<std::string> arguments, int input = -1);
  bool isRunning() const { return process_ > 0; }  // started, and wait was not called
  // Waits for its end. Returns an empty text if it reported success, else how it ended.
  std::string wait();
  void kill();
  // The end of what it wrote to its standard output and error output.
  std::string lastWords() const;

 private:
  pid_t process_ = -1;
  Descriptor messages_;  // a memory file
};

}  // namespace tessera
