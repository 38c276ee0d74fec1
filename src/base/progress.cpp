#include "base/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace tessera {
namespace {

using std::chrono::duration;
using std::chrono::steady_clock;

constexpr double kTerminalInterval = 0.1, kPlainInterval = 5.0;  // seconds between prints
constexpr int kBarWidth = 24;

std::string formatSeconds(double seconds) {
  if (!std::isfinite(seconds) || seconds > 359999) return "--:--";
  const int whole = static_cast<int>(seconds + 0.5);
  if (whole < 3600) return fmt::format("{}:{:02}", whole / 60, whole % 60);
  return fmt::format("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60);
}

std::string formatRate(double rate) {
  if (rate >= 1e6) return fmt::format("{:.2f} M", rate * 1e-6);
  if (rate >= 1e4) return fmt::format("{:.1f} k", rate * 1e-3);
  if (rate >= 100) return fmt::format("{:.0f} ", rate);
  return fmt::format("{:.2f} ", rate);
}

}  // namespace

Progress::Progress(std::string title, int64_t total, std::string unit)
    : title_(std::move(title)),
      unit_(std::move(unit)),
      total_(total),
      terminal_(::isatty(STDERR_FILENO) == 1),
      start_(steady_clock::now()),
      lastPrint_(start_) {}

Progress::~Progress() {
  if (!finished_ && terminal_ && startedAt_ >= 0) std::fputc('\n', stderr);  // an error message starts on its own line
}

void Progress::update(int64_t done, const std::string& note) {
  const auto now = steady_clock::now();
  if (startedAt_ < 0) {  // a resumed run starts above 0: the rate is that of this run
    startedAt_ = done;
    start_ = now;
  }
  done_ = done;
  if (duration<double>(now - lastPrint_).count() < (terminal_ ? kTerminalInterval : kPlainInterval)) return;
  lastPrint_ = now;
  print(note, false);
}

void Progress::finish(const std::string& note) {
  if (finished_) return;
  finished_ = true;
  print(note, true);
}

void Progress::print(const std::string& note, bool last) {
  const double seconds = duration<double>(steady_clock::now() - start_).count();
  const int64_t here = done_ - std::max<int64_t>(startedAt_, 0);
  const double rate = seconds > 0 ? static_cast<double>(here) / seconds : 0;
  std::string line = title_ + ":";
  if (total_ > 0) {
    const double share = std::clamp(static_cast<double>(done_) / static_cast<double>(total_), 0.0, 1.0);
    if (terminal_) {
      const int filled = static_cast<int>(share * kBarWidth);
      line += fmt::format(" [{}{}]", std::string(filled, '#'), std::string(kBarWidth - filled, '.'));
    }
    line += fmt::format(" {:.0f} % ({}/{} {})", std::floor(share * 100), done_, total_, unit_);
  } else {
    line += fmt::format(" {} {}", done_, unit_);
  }
  if (here > 0 && rate > 0) line += fmt::format(", {}{}/s", formatRate(rate), unit_);
  if (last) {
    line += ", took " + formatSeconds(seconds);
  } else if (total_ > done_ && rate > 0) {
    line += fmt::format(", {} left", formatSeconds(static_cast<double>(total_ - done_) / rate));
  }
  if (!note.empty()) line += ", " + note;
  // Written in a single call, so that lines of other threads cannot interleave with it.
  const std::string text = terminal_ ? "\r" + line + "\x1b[K" + (last ? "\n" : "") : line + "\n";
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

}  // namespace tessera
