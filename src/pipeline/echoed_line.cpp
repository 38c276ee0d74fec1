#include "pipeline/echoed_line.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace tessera {
namespace {

constexpr std::chrono::seconds kBetweenLines{30};  // elsewhere than on a terminal
constexpr size_t kColumns = 120;

}  // namespace

EchoedLine::EchoedLine() : terminal_(::isatty(STDERR_FILENO) == 1), last_(std::chrono::steady_clock::now()) {}

void EchoedLine::show(const std::string& line) {
  const auto now = std::chrono::steady_clock::now();
  if (line.empty() || line == shown_ || (!terminal_ && now - last_ < kBetweenLines)) return;
  shown_ = line;
  last_ = now;
  // Control characters of a file of messages would act on the terminal.
  std::string text = line.substr(0, kColumns);
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  std::fprintf(stderr, terminal_ ? "\r\033[K%s" : "%s\n", text.c_str());
  std::fflush(stderr);
}

void EchoedLine::clear() {
  if (terminal_ && !shown_.empty()) std::fputs("\r\033[K", stderr);
  shown_.clear();
}

}  // namespace tessera
