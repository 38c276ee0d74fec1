#include "pipeline/verb_process.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <fstream>
#include <set>
#include <string_view>

#include "base/child_process.h"
#include "base/error.h"
#include "base/log.h"
#include "pipeline/echoed_line.h"

namespace tessera {
namespace {

constexpr std::array kInterruptions = {SIGINT, SIGTERM, SIGHUP};

// Whether a verb has ended for an interruption, by itself or without being asked.
bool isInterrupted(const ChildProcess& process) {
  constexpr int kStatus = 128;  // interruptedStatus
  return std::any_of(kInterruptions.begin(), kInterruptions.end(),
                     [&](int signal) { return process.signal() == signal || process.status() == kStatus + signal; });
}

// Repeats the warnings in a log behind its first `begin` bytes, once each.
void repeatWarnings(const std::string& verb, const fs::path& log, uint64_t begin) {
  constexpr std::string_view kWarning = "warning: ";
  std::ifstream file(log, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(begin));
  std::set<std::string> warnings;
  for (std::string line; warnings.size() < WarningRecorder::kMaxRecorded && std::getline(file, line);)
    if (line.starts_with(kWarning) && warnings.insert(line).second) warn("{}: {}", verb, line.substr(kWarning.size()));
}

}  // namespace

std::string runVerb(const PhotoRunOptions& options, const std::string& verb, std::vector<std::string> arguments) {
  const fs::path log = options.out / "logs" / (verb + ".log");
  arguments.insert(arguments.begin(), {options.program, verb, "--device", options.device});
  if (options.threads > 0) arguments.insert(arguments.end(), {"--threads", std::to_string(options.threads)});
  ChildProcess process;
  std::error_code status;
  const uint64_t before = fs::exists(log, status) ? fs::file_size(log) : 0;
  const std::string failure = process.start(arguments, {.log = log, .hasOwnGroup = true});
  if (!failure.empty()) throw Error(options.program, "", "cannot be run: " + failure, "install it again");
  const auto lastLine = [&process] {
    const std::string words = process.lastWords();
    return words.substr(words.rfind('\n') == words.npos ? 0 : words.rfind('\n') + 1);
  };
  EchoedLine echo;
  // It is interrupted in its own way: training writes a checkpoint.
  constexpr double kSecondsBetweenLooks = 0.2;
  for (bool asked = false; !process.waitFor(kSecondsBetweenLooks);) {
    echo.show(lastLine());
    if (asked || !options.interrupted()) continue;
    process.interrupt();
    asked = true;
  }
  echo.clear();
  repeatWarnings(verb, log, before);
  const std::string end = process.wait();
  if (!end.empty()) {
    if (options.interrupted()) {
      // What else went wrong is lost with the interruption, such as a checkpoint for which there was no space.
      if (!isInterrupted(process)) warn("tessera {} {}: {}", verb, end, lastLine());
      throw RunInterrupted();
    }
    throw Error("tessera " + verb, "", end + ": " + lastLine(), "see " + log.string() + "; run again to go on");
  }
  return lastLine();
}

}  // namespace tessera
