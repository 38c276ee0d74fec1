// Reports progress on stderr: a bar with the rate and the time left on a terminal, a plain line every few seconds
// elsewhere.
#pragma once

#include <chrono>
#include <string>

namespace tessera {

class Progress {
 public:
  // `unit` names what is counted ("steps", "photos"); `total` is 0 while it is unknown.
  Progress(std::string title, int64_t total, std::string unit);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void setTotal(int64_t total) { total_ = total; }
  // Shows `note` after the bar ("27.3 dB"). Cheap enough to be called in every step.
  void update(int64_t done, const std::string& note = {});
  void finish(const std::string& note = {});

 private:
  void print(const std::string& note, bool last);

  std::string title_, unit_;
  int64_t total_, done_ = 0, startedAt_ = -1;
  bool terminal_, finished_ = false;
  std::chrono::steady_clock::time_point start_, lastPrint_;
};

}  // namespace tessera
