// A sequence of stages, each of which turns files into files. What is finished is not repeated: run.json records for
// each stage a digest of everything that its result depends on.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "base/file.h"

namespace tessera {

// What a stage will take.
struct StageNeeds {
  double seconds = 0;
  int64_t memoryBytes = 0;  // at once, of the programs that it runs
  int64_t diskBytes = 0;    // that it adds
  // Of these, what follows from a guess of how large the place is.
  int64_t guessedMemoryBytes = 0, guessedDiskBytes = 0;
};

struct Stage {
  std::string name;
  std::string settings;  // what its result depends on, besides the results of earlier stages
  // Returns a digest of what else its result depends on: results of earlier stages that other programs may change, too.
  // It is recorded when the stage begins; a stage whose digest has changed since is run again. Empty: nothing.
  std::function<std::string()> inputs = [] { return std::string(); };
  std::function<bool()> isComplete = [] { return true; };  // whether what it wrote is still there
  // Removes what a result for other settings has left, which `run` must not use; called before it begins anew.
  std::function<void()> discard = [] {};
  // What it will take, by what is known when this is called.
  std::function<StageNeeds(bool resumes)> needs = [](bool) { return StageNeeds{}; };
  // Whether what later stages need is only known after it: run.json then records what they are expected to take.
  bool revealsNeeds = false;
  // Returns what it achieved, for the line that is printed. `resumes`: it was interrupted, and nothing that its result
  // depends on has changed since: what it has written so far may be used.
  std::function<std::string(bool resumes)> run;
};

// What run.json says of a stage that is finished.
struct StageRecord {
  std::string name, summary;
  double seconds = 0;
  int64_t peakBytes = 0;  // of memory, of this process or of a program that the stage ran, the larger one
  std::vector<std::string> warnings;
};

struct StageRange {
  // Run again from this stage on, even if it is finished; empty: what is not finished. A call with the same stage after
  // one that was interrupted goes on with it.
  std::string from;
  std::string until;  // the last stage to run; empty: all
};

// What the stages of a range that are not finished will take, in their order.
struct RunPlan {
  struct Entry {
    std::string stage;
    StageNeeds needs;
  };
  std::vector<Entry> entries;

  StageNeeds total() const;  // the sums of seconds and of disk, and the most memory at once
};

// Plans what `runStages` would run. Throws Error if a stage of `range` does not exist.
RunPlan planStages(const fs::path& folder, const std::vector<Stage>& stages, const StageRange& range);

// What run.json says of what was asked for.
struct RunRequest {
  std::string command;                       // for people
  std::map<std::string, std::string> flags;  // values by name, for readFlags
};

// Runs the stages in order, and prints a line for each on stdout, with the time that those after it will take. run.json
// records what they were expected to take, all before the first one runs (of finished stages, what they took), and each
// when it begins, with the warnings that it gives. What interrupted attempts at a stage took, and their warnings, are
// added to its record, unless they were killed. Throws
// Error if a stage of `range` does not exist or the last one precedes the first, and what a stage or `check` throws,
// which is called before each stage that runs.
void runStages(
    const fs::path& folder, const RunRequest& request, const std::vector<Stage>& stages, const StageRange& range,
    const std::function<void()>& check = [] {});

// Returns the flags of the last run in this folder; nothing if run.json is missing or damaged.
std::map<std::string, std::string> readFlags(const fs::path& folder);

// Writes a run.json without stages if the folder has none: what is made in the folder from now on is a run's.
void claimFolder(const fs::path& folder);

// Returns the finished stages of a run in this folder; to a stage that runs, those before it. Nothing if run.json is
// missing or damaged.
std::vector<StageRecord> readStageRecords(const fs::path& folder);

// Returns a time for people: "40 s", "12 min", "3.5 h".
std::string describeDuration(double seconds);

// Returns a digest of a text, 16 hexadecimal digits.
std::string textDigest(const std::string& text);

}  // namespace tessera
