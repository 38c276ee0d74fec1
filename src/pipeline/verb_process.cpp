#include "pipeline/verb_process.h"

#include "base/child_process.h"
#include "base/error.h"
#include "pipeline/echoed_line.h"

namespace tessera {

StageOutcome runVerb(const PhotoRunOptions& options, const std::string& verb, std::vector<std::string> arguments) {
  const fs::path log = options.out / "logs" / (verb + ".log");
  arguments.insert(arguments.begin(), {options.program, verb, "--device", options.device});
  if (options.threads > 0) arguments.insert(arguments.end(), {"--threads", std::to_string(options.threads)});
  ChildProcess process;
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
  const std::string end = process.wait();
  if (!end.empty()) {
    if (options.interrupted()) throw RunInterrupted();
    throw Error("tessera " + verb, "", end + ": " + lastLine(), "see " + log.string() + "; run again to go on");
  }
  return {process.peakBytes(), lastLine()};
}

}  // namespace tessera
