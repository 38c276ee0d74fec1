#include "pipeline/stage.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/memory.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

struct Record {
  std::string digest, summary;
  bool isFinished = false;
  double seconds = 0;
  int64_t peakBytes = 0;
};

// What run.json of an earlier run says of stages; nothing if the file is missing or damaged: then all is run again.
std::vector<std::pair<std::string, Record>> readRecords(const fs::path& file, std::string& begunFrom) {
  std::vector<std::pair<std::string, Record>> records;
  constexpr uint64_t kMaxBytes = 1 << 20;
  std::error_code status;
  if (!fs::exists(file, status)) return records;
  const Json run = Json::parse(readTextFile(file, kMaxBytes), nullptr, false);
  if (!run.is_object() || !run.contains("stages") || !run["stages"].is_array()) return records;
  if (run.contains("begun_from") && run["begun_from"].is_string()) begunFrom = run["begun_from"].get<std::string>();
  for (const Json& stage : run["stages"]) {
    if (!stage.is_object() || !stage.contains("name") || !stage["name"].is_string()) continue;
    Record entry;
    const auto text = [&](const char* key) {
      return stage.contains(key) && stage[key].is_string() ? stage[key].get<std::string>() : std::string();
    };
    const auto number = [&](const char* key) {
      return stage.contains(key) && stage[key].is_number() ? stage[key].get<double>() : 0.0;
    };
    entry.digest = text("digest");
    entry.summary = text("summary");
    entry.isFinished = stage.contains("finished") && stage["finished"] == true;
    entry.seconds = number("seconds");
    entry.peakBytes = static_cast<int64_t>(number("peak_bytes"));
    records.emplace_back(stage["name"].get<std::string>(), entry);
  }
  return records;
}

Json toJson(const std::string& name, const Record& result) {
  return {{"name", name},
          {"digest", result.digest},
          {"finished", result.isFinished},
          {"seconds", result.seconds},
          {"peak_bytes", result.peakBytes},
          {"summary", result.summary}};
}

// Names of files need not be UTF-8.
void write(const Json& run, const fs::path& file) {
  writeFileAtomically(file, run.dump(2, ' ', false, Json::error_handler_t::replace) + "\n", true);
}

std::string describeSeconds(double seconds) {
  const auto whole = static_cast<int64_t>(seconds + 0.5);
  return fmt::format("{}:{:02}", whole / 60, whole % 60);
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

}  // namespace

std::string textDigest(const std::string& text) {
  uint64_t hash = 0xcbf29ce484222325;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return fmt::format("{:016x}", hash);
}

void runStages(const fs::path& folder, const std::string& request, const std::vector<Stage>& stages,
               const StageRange& range, const std::function<void()>& check) {
  requireStage(stages, range.from, "--from");
  requireStage(stages, range.until, "--until");
  const fs::path file = folder / "run.json";
  std::string begunFrom;  // what an interrupted call was asked to run again from
  const auto before = readRecords(file, begunFrom);
  const bool wasInterrupted =
      before.size() < stages.size() ||
      std::any_of(before.begin(), before.end(), [](const auto& entry) { return !entry.second.isFinished; });
  const std::string from = wasInterrupted && range.from == begunFrom ? "" : range.from;
  Json run = {{"version", 1}, {"request", request}, {"stages", Json::array()}};
  if (!range.from.empty()) run["begun_from"] = range.from;
  std::string digest;
  bool again = false;
  for (const Stage& stage : stages) {
    digest = textDigest(digest + "\n" + stage.name + "\n" + stage.settings);
    again = again || stage.name == from;
    const auto known =
        std::find_if(before.begin(), before.end(), [&](const auto& entry) { return entry.first == stage.name; });
    const bool isKnown = !again && known != before.end() && known->second.digest == digest;
    Record result;
    if (isKnown && known->second.isFinished && stage.isComplete()) {
      result = known->second;
      fmt::print("{:<10} finished before: {}\n", stage.name, result.summary);
    } else {
      check();
      // Results of later stages end with those of this one, also if it is interrupted.
      again = true;
      // What it left is discarded before the record says that the stage may be resumed.
      const bool resumes = isKnown && !known->second.isFinished;
      result.digest = digest;
      if (!resumes) {
        write(run, file);
        stage.discard();
      }
      Json begun = run;
      begun["stages"].push_back(toJson(stage.name, result));
      write(begun, file);
      const auto start = std::chrono::steady_clock::now();
      const StageOutcome outcome = stage.run(resumes);
      result.isFinished = true;
      result.summary = outcome.summary;
      result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      result.peakBytes = std::max(outcome.peakBytes, residentBytes());
      fmt::print("{:<10} {}: {}\n", stage.name, describeSeconds(result.seconds), result.summary);
    }
    std::fflush(stdout);
    run["stages"].push_back(toJson(stage.name, result));
    if (again) write(run, file);
    if (stage.name == range.until) break;
  }
  if (run.erase("begun_from") > 0 && again) write(run, file);
}

}  // namespace tessera
