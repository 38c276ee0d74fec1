// The last message of another program, shown on stderr: in place on a terminal, a line now and then elsewhere.
#pragma once

#include <chrono>
#include <string>

namespace tessera {

class EchoedLine {
 public:
  EchoedLine();

  // Cheap enough to be called several times a second.
  void show(const std::string& line);
  void clear();  // removes it from a terminal

 private:
  bool terminal_;
  std::string shown_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace tessera
