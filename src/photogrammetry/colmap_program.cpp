#include "photogrammetry/colmap_program.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <csignal>

#include "base/child_process.h"
#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

constexpr double kSecondsBetweenLooks = 0.5;
constexpr size_t kLastWords = 1 << 14;  // a trace of its stack may follow the reason

// Whether a program was ended from outside.
bool isKilled(const ChildProcess& process) {
  constexpr std::array kSignals = {SIGKILL, SIGTERM, SIGINT, SIGHUP};
  return std::find(kSignals.begin(), kSignals.end(), process.signal()) != kSignals.end();
}

}  // namespace

ColmapProgram::ColmapProgram(fs::path log, std::string program) : log_(std::move(log)), program_(std::move(program)) {
  ChildProcess process;
  const std::string failure = process.start({program_, "help"}, {.hasOwnGroup = true});
  const std::string remedy = fmt::format("install COLMAP {}: apt-get install colmap", kColmapVersion);
  if (!failure.empty()) throw Error(program_, "", "cannot be run: " + failure, remedy);
  const std::string helped = process.wait();
  if (isKilled(process)) throw ColmapKilled(program_ + " help", "", helped, "run again to go on");
  const std::string help = process.lastWords(1 << 16);
  const size_t at = help.find("COLMAP ");
  if (at == help.npos) throw Error(program_, "", "does not say that it is COLMAP", remedy);
  const size_t begin = at + 7;
  const std::string version = help.substr(begin, help.find_first_of(" \n", begin) - begin);
  if (version != kColmapVersion) {
    throw Error(
        program_, "",
        fmt::format("is COLMAP {}; only {} has been tested, and others differ in options and files", version,
                    kColmapVersion),
        fmt::format("put a program `colmap` of version {} first in PATH (Debian 12 has it, and its sources build as "
                    "tag {}), or pose the photos by other means and use `tessera import`",
                    kColmapVersion, kColmapVersion));
  }
}

void ColmapProgram::run(std::vector<std::string> arguments, const std::function<void()>& watch,
                        const std::function<bool()>& isDone) {
  const std::string command = arguments.at(0);
  arguments.insert(arguments.begin(), program_);
  ChildProcess process;
  const std::string failure = process.start(std::move(arguments), {.log = log_, .hasOwnGroup = true});
  if (!failure.empty()) throw Error(program_, "", "cannot be run: " + failure, "install it again");
  while (!process.waitFor(kSecondsBetweenLooks)) {
    if (watch) watch();
  }
  const std::string end = process.wait();
  // What it wrote may then be incomplete, whatever it reports.
  if (isNearlyFull(fs::absolute(log_).parent_path())) {
    throw ColmapKilled(program_ + " " + command, "", "has left hardly any space on the disk of " + log_.string(),
                       "free some, and run again to go on");
  }
  if (end.empty()) return;
  if (isKilled(process) || process.lastWords(kLastWords).find("bad_alloc") != std::string::npos) {
    throw ColmapKilled(program_ + " " + command, "", end,
                       "if memory ran out, close other programs or use fewer threads; run again to go on");
  }
  if (isDone && isDone()) {
    inform("{} {} {}, but had finished", program_, command, end);
    return;
  }
  throw Error(program_ + " " + command, "", end + ": " + process.lastWords(200),
              "see " + log_.string() + "; run again to go on");
}

}  // namespace tessera
