// What a program writes to its standard output, read as a stream while it runs: more than memory holds.
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>
#include <span>
#include <string>

#include "base/child_process.h"

namespace tessera {

class OutputPipe {
 public:
  OutputPipe();  // throws Error if the process has no descriptors left

  int writeEnd() const { return writeEnd_.get(); }  // for ChildOptions::output

  // Fills `bytes`, and returns how many came before the end of the output. The program must have been started: the
  // first call closes the writing end of this process, which would keep the end from coming. `watch` is called a few
  // times a second; what it throws is passed on.
  size_t read(std::span<std::byte> bytes, const std::function<void()>& watch = {});
  // The rest of the output, at most `maxBytes` of it.
  std::string readText(size_t maxBytes, const std::function<void()>& watch = {});

 private:
  Descriptor readEnd_, writeEnd_;
  std::chrono::steady_clock::time_point lastWatch_;
};

}  // namespace tessera
