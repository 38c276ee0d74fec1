#include "pipeline/stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/child_process.h"
#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kRecord = "run.json";
constexpr double kLongSeconds = 30;  // what takes less is not announced

struct Record {
  std::string digest, summary;
  bool isFinished = false;
  double seconds = 0;
  int64_t peakBytes = 0;
  StageNeeds expected;
  std::string inputs;
  std::vector<std::string> warnings;
};

// Whether anybody still reads it does not matter: the terminal may have been closed.
void say(const std::string& line) {
  std::fwrite(line.data(), 1, line.size(), stdout);
  std::fflush(stdout);
}

// Returns what run.json of an earlier run says; nothing if the file is missing or damaged.
Json readRun(const fs::path& file) {
  constexpr uint64_t kMaxBytes = 16 << 20;
  std::error_code status;
  return fs::exists(file, status) ? Json::parse(readTextFile(file, kMaxBytes), nullptr, false) : Json();
}

// What run.json of an earlier run says of stages; nothing if the file is missing or damaged: then all is run again.
std::vector<std::pair<std::string, Record>> readRecords(const fs::path& file, std::string& begunFrom) {
  std::vector<std::pair<std::string, Record>> records;
  const Json run = readRun(file);
  if (!run.is_object() || !run.contains("stages") || !run["stages"].is_array()) return records;
  if (run.contains("begun_from") && run["begun_from"].is_string()) begunFrom = run["begun_from"].get<std::string>();
  for (const Json& stage : run["stages"]) {
    if (!stage.is_object() || !stage.contains("name") || !stage["name"].is_string()) continue;
    Record entry;
    const auto text = [&](const char* key) {
      return stage.contains(key) && stage[key].is_string() ? stage[key].get<std::string>() : std::string();
    };
    const auto number = [&](const char* key) {
      constexpr double kMaxNumber = 1e18;  // that any of these numbers can mean
      const double value = stage.contains(key) && stage[key].is_number() ? stage[key].get<double>() : 0.0;
      return value >= 0 && value < kMaxNumber ? value : 0.0;
    };
    entry.digest = text("digest");
    entry.summary = text("summary");
    entry.inputs = text("inputs");
    if (stage.contains("warnings") && stage["warnings"].is_array()) {
      for (const Json& warning : stage["warnings"])
        if (warning.is_string()) entry.warnings.push_back(warning.get<std::string>());
    }
    entry.isFinished = stage.contains("finished") && stage["finished"] == true;
    entry.seconds = number("seconds");
    entry.peakBytes = static_cast<int64_t>(number("peak_bytes"));
    entry.expected = {number("expected_seconds"), static_cast<int64_t>(number("expected_peak_bytes")), 0};
    records.emplace_back(stage["name"].get<std::string>(), entry);
  }
  return records;
}

Json toJson(const std::string& name, const Record& result) {
  Json stage = {{"name", name},
                {"digest", result.digest},
                {"finished", result.isFinished},
                {"seconds", result.seconds},
                {"peak_bytes", result.peakBytes},
                {"expected_seconds", result.expected.seconds},
                {"expected_peak_bytes", result.expected.memoryBytes},
                {"summary", result.summary}};
  if (!result.inputs.empty()) stage["inputs"] = result.inputs;
  if (!result.warnings.empty()) stage["warnings"] = result.warnings;
  return stage;
}

// Adds warnings, once each, as long as the record stays small.
void addWarnings(std::vector<std::string>& all, const std::vector<std::string>& more) {
  constexpr size_t kLongest = 1000;
  for (std::string text : more) {
    if (text.size() > kLongest) text = text.substr(0, kLongest) + " …";
    const bool isKnown = std::find(all.begin(), all.end(), text) != all.end();
    if (!isKnown && all.size() < WarningRecorder::kMaxRecorded) all.push_back(text);
  }
}

// Names of files need not be UTF-8.
void write(const Json& run, const fs::path& file) {
  writeFileAtomically(file, run.dump(2, ' ', false, Json::error_handler_t::replace) + "\n", true);
}

void requireStage(const std::vector<Stage>& stages, const std::string& name, const char* flag) {
  if (name.empty()) return;
  std::string names;
  for (const Stage& stage : stages) {
    if (stage.name == name) return;
    names += (names.empty() ? "" : ", ") + stage.name;
  }
  throw Error(fmt::format("{} {}", flag, name), "", "there is no such stage", "name one of " + names);
}

std::string describeClock(double seconds) {
  const auto whole = static_cast<int64_t>(seconds + 0.5);
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
}

// What an earlier call has left to do.
struct Remaining {
  std::vector<std::string> digests;   // of all stages
  size_t first = 0, end = 0;          // the stages to run
  std::vector<Record> known;          // of the stages before these
  std::optional<Record> interrupted;  // the first of them, if it was
};

Remaining findRemaining(const fs::path& folder, const std::vector<Stage>& stages, const StageRange& range) {
  requireStage(stages, range.from, "--from");
  requireStage(stages, range.until, "--until");
  const auto position = [&](const std::string& name) {
    return std::find_if(stages.begin(), stages.end(), [&](const Stage& stage) { return stage.name == name; });
  };
  if (!range.from.empty() && !range.until.empty() && position(range.from) > position(range.until))
    throw Error("--from " + range.from, "", "comes after --until " + range.until, "exchange them, or leave one out");
  std::string begunFrom;  // what an interrupted call was asked to run again from
  const auto before = readRecords(folder / kRecord, begunFrom);
  const bool wasInterrupted =
      before.size() < stages.size() ||
      std::any_of(before.begin(), before.end(), [](const auto& entry) { return !entry.second.isFinished; });
  const std::string from = wasInterrupted && range.from == begunFrom ? "" : range.from;
  Remaining remaining;
  std::string digest;
  bool again = false;
  for (const Stage& stage : stages) {
    digest = textDigest(digest + "\n" + stage.name + "\n" + stage.settings);
    remaining.digests.push_back(digest);
    ++remaining.end;
    // What follows a stage that has to be run is run, too: its results end with those of that stage, also if it is
    // interrupted.
    if (!again) {
      const auto record =
          std::find_if(before.begin(), before.end(), [&](const auto& entry) { return entry.first == stage.name; });
      // Records of former versions name no inputs.
      const bool isKnown = stage.name != from && record != before.end() && record->second.digest == digest &&
                           (record->second.inputs.empty() || record->second.inputs == stage.inputs());
      if (isKnown && record->second.isFinished && stage.isComplete()) {
        remaining.known.push_back(record->second);
        // What is there now counts as what it has read.
        if (record->second.inputs.empty()) remaining.known.back().inputs = stage.inputs();
        ++remaining.first;
      } else {
        again = true;
        if (isKnown && !record->second.isFinished) remaining.interrupted = record->second;
      }
    }
    if (stage.name == range.until) break;
  }
  return remaining;
}

RunPlan planRemaining(const std::vector<Stage>& stages, const Remaining& remaining) {
  RunPlan plan;
  for (size_t i = remaining.first; i < remaining.end; ++i)
    plan.entries.push_back({stages[i].name, stages[i].needs(i == remaining.first && remaining.interrupted)});
  return plan;
}

}  // namespace

std::string describeDuration(double seconds) {
  constexpr double kMinute = 60, kHour = 3600;
  if (seconds < kMinute) return fmt::format("{:.0f} s", seconds);
  if (seconds < 2 * kHour) return fmt::format("{:.0f} min", seconds / kMinute);
  return fmt::format("{:.1f} h", seconds / kHour);
}

StageNeeds RunPlan::total() const {
  StageNeeds total;
  for (const Entry& entry : entries) {
    total.seconds += entry.needs.seconds;
    total.memoryBytes = std::max(total.memoryBytes, entry.needs.memoryBytes);
    total.diskBytes += entry.needs.diskBytes;
    total.guessedDiskBytes += entry.needs.guessedDiskBytes;
  }
  return total;
}

std::vector<StageRecord> readStageRecords(const fs::path& folder) {
  std::string begunFrom;
  std::vector<StageRecord> stages;
  for (const auto& [name, result] : readRecords(folder / "run.json", begunFrom))
    if (result.isFinished) stages.push_back({name, result.summary, result.seconds, result.peakBytes, result.warnings});
  return stages;
}

void claimFolder(const fs::path& folder) {
  std::error_code status;
  if (!fs::exists(folder / kRecord, status)) write({{"version", 1}, {"stages", Json::array()}}, folder / kRecord);
}

std::string textDigest(const std::string& text) {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return fmt::format("{:016x}", hash);
}

RunPlan planStages(const fs::path& folder, const std::vector<Stage>& stages, const StageRange& range) {
  return planRemaining(stages, findRemaining(folder, stages, range));
}

std::map<std::string, std::string> readFlags(const fs::path& folder) {
  std::map<std::string, std::string> flags;
  const Json run = readRun(folder / kRecord);
  if (!run.is_object() || !run.contains("flags") || !run["flags"].is_object()) return flags;
  for (const auto& [name, value] : run["flags"].items())
    if (value.is_string()) flags[name] = value.get<std::string>();
  return flags;
}

void runStages(const fs::path& folder, const RunRequest& request, const std::vector<Stage>& stages,
               const StageRange& range, const std::function<void()>& check) {
  const Remaining remaining = findRemaining(folder, stages, range);
  const fs::path file = folder / kRecord;
  Json run = {{"version", 1}, {"request", request.command}, {"flags", request.flags}, {"stages", Json::array()}};
  if (!range.from.empty()) run["begun_from"] = range.from;
  const auto record = [&run](const StageNeeds& total) {
    run["expected"] = {{"seconds", total.seconds}, {"peak_bytes", total.memoryBytes}, {"disk_bytes", total.diskBytes}};
  };
  // Of the whole run: what is done counts as it took.
  RunPlan plan = planRemaining(stages, remaining);
  std::vector<Record> done = remaining.known;
  if (remaining.interrupted) done.push_back(*remaining.interrupted);
  for (const Record& before : done) plan.entries.push_back({"", {before.seconds, before.peakBytes, 0}});
  record(plan.total());
  if (remaining.first == remaining.end) {  // the next call without flags is for those of this one all the same
    Json before = readRun(file);
    if (before.is_object()) {
      before["request"] = request.command;
      before["flags"] = request.flags;
      for (Json& stage : before["stages"]) {
        for (size_t i = 0; i < remaining.first; ++i)
          if (stage.is_object() && stage["name"] == stages[i].name) stage = toJson(stages[i].name, remaining.known[i]);
      }
      write(before, file);
    }
  }
  for (size_t i = 0; i < remaining.first; ++i) {
    say(fmt::format("{:<10} finished before: {}\n", stages[i].name, remaining.known[i].summary));
    run["stages"].push_back(toJson(stages[i].name, remaining.known[i]));
  }
  for (size_t i = remaining.first; i < remaining.end; ++i) {
    const Stage& stage = stages[i];
    check();
    // What it left is discarded before the record says that the stage may be resumed.
    const bool resumes = i == remaining.first && remaining.interrupted.has_value();
    if (!resumes) {
      write(run, file);
      stage.discard();
    }
    const StageNeeds needs = stage.needs(resumes);
    // What interrupted attempts took counts.
    const Record before = resumes ? *remaining.interrupted : Record{.expected = needs};
    Record result{.digest = remaining.digests[i],
                  .seconds = before.seconds,
                  .peakBytes = before.peakBytes,
                  .expected = before.expected,
                  .inputs = stage.inputs(),
                  .warnings = before.warnings};
    const auto recordBegun = [&] {
      Json begun = run;
      begun["stages"].push_back(toJson(stage.name, result));
      write(begun, file);
    };
    recordBegun();
    if (i > remaining.first && needs.seconds > kLongSeconds)
      inform("{} will take about {}", stage.name, describeDuration(needs.seconds));
    const bool measuresPeak = restartPeakResidentBytes();
    takePeakOfChildren();
    const auto start = std::chrono::steady_clock::now();
    const WarningRecorder warnings;
    const auto count = [&] {
      addWarnings(result.warnings, warnings.texts());
      result.seconds = before.seconds + std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      result.peakBytes =
          std::max({before.peakBytes, takePeakOfChildren(), measuresPeak ? peakResidentBytes() : residentBytes()});
    };
    try {
      result.summary = stage.run(resumes);
    } catch (...) {
      count();
      try {
        recordBegun();
      } catch (const Error&) {  // what ended the stage matters more
      }
      throw;
    }
    count();
    result.isFinished = true;
    run["stages"].push_back(toJson(stage.name, result));
    write(run, file);  // at once: what the others need takes time to tell
    RunPlan later;
    for (size_t k = i + 1; k < remaining.end; ++k) later.entries.push_back({stages[k].name, stages[k].needs(false)});
    const double left = later.total().seconds;
    if (stage.revealsNeeds) {
      later.entries.push_back({stage.name, {result.seconds, result.peakBytes, 0}});
      record(later.total());
      write(run, file);
    }
    say(fmt::format("{:<10} {}: {}{}\n", stage.name, describeClock(result.seconds), result.summary,
                    left > kLongSeconds ? fmt::format(" (about {} left)", describeDuration(left)) : ""));
  }
  if (run.erase("begun_from") > 0 && remaining.first < remaining.end) write(run, file);
}

}  // namespace tessera
