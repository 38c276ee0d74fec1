// The program `colmap`, which extracts and matches features and estimates poses. It is run as it is installed, never
// linked. Source: https://colmap.github.io, version 3.8, whose options and files other versions rename or extend.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/file.h"

namespace tessera {

inline constexpr const char* kColmapVersion = "3.8";

struct ColmapSettings {
  std::string program = "colmap";
  int threads = 0;  // 0: all

  std::string threadsText() const { return threads > 0 ? std::to_string(threads) : "-1"; }
};

// That something else has ended the program, or a lack of memory or disk space: no result of it, but to be run again.
class ColmapKilled : public Error {
 public:
  using Error::Error;
};

class ColmapProgram {
 public:
  // `program` is looked up in PATH. Its output is appended to `log`. Throws Error if it cannot be run, or is of another
  // version than kColmapVersion, and ColmapKilled as `run` does.
  explicit ColmapProgram(fs::path log, std::string program = "colmap");

  // Runs a command, such as {"mapper", "--output_path", "sparse"}. `watch` is called now and then while it runs.
  // Throws ColmapKilled if it was ended from outside or memory or disk ran out, and else Error with its last words if
  // it reports failure, unless `isDone` says that it has written all of its result. That it reports success means
  // little: callers look at what it wrote.
  void run(std::vector<std::string> arguments, const std::function<void()>& watch = {},
           const std::function<bool()>& isDone = {});

 private:
  fs::path log_;
  std::string program_;
};

}  // namespace tessera
