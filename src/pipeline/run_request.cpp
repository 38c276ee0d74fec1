#include "pipeline/run_request.h"

#include <fmt/format.h>

#include <cstdlib>

#include "base/error.h"
#include "base/log.h"
#include "import/holdout.h"
#include "photogrammetry/photo_list.h"

namespace tessera {
namespace {

constexpr std::string_view kListOfHeldOut = "list:";  // of --holdout

// So that it is found from any folder.
std::string absolutePath(const fs::path& path) {
  return path.empty() ? "" : fs::absolute(path).lexically_normal().string();
}

// The flags that the results depend on. Those whose value is the default of nothing are left out.
std::map<std::string, std::string> describeFlags(const PhotoRunOptions& options) {
  std::map<std::string, std::string> flags = {
      {"--method", options.method}, {"--device", options.device}, {"--holdout", options.holdout}};
  if (options.holdout.starts_with(kListOfHeldOut))
    flags["--holdout"] = std::string(kListOfHeldOut) + absolutePath(options.holdout.substr(kListOfHeldOut.size()));
  if (options.steps > 0) {
    flags["--steps"] = std::to_string(options.steps);
  } else {
    flags["--minutes"] = fmt::format("{}", options.minutes);
  }
  if (options.downscale > 0) flags["--downscale"] = std::to_string(options.downscale);
  if (options.frames > 0) flags["--frames"] = std::to_string(options.frames);
  if (!options.masks.empty()) flags["--masks"] = absolutePath(options.masks);
  return flags;
}

// Reads a positive number.
template <typename T>
bool readPositive(const std::string& text, double most, T& number) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != 0 || !(value > 0) || value > most) return false;
  number = static_cast<T>(value);
  return number > 0;
}

// Returns whether there is such a flag and it can have this value.
bool setFlag(PhotoRunOptions& options, const std::string& flag, const std::string& value) {
  constexpr double kMaxMinutes = 1e7, kMaxSteps = 1e12, kMaxDownscale = 64, kMaxFrames = 5000;
  if (flag == "--minutes") {
    options.steps = 0;
    return readPositive(value, kMaxMinutes, options.minutes);
  }
  if (flag == "--steps") return readPositive(value, kMaxSteps, options.steps);
  if (flag == "--downscale") return readPositive(value, kMaxDownscale, options.downscale);
  if (flag == "--frames") return readPositive(value, kMaxFrames, options.frames);
  if (flag == "--method") options.method = value;
  if (flag == "--device") options.device = value;
  if (flag == "--holdout") options.holdout = value;
  if (flag == "--masks") options.masks = value;
  return !value.empty();
}

}  // namespace

bool liesIn(const fs::path& path, const fs::path& folder) {
  const fs::path inside =
      fs::weakly_canonical(fs::absolute(path)).lexically_relative(fs::weakly_canonical(fs::absolute(folder)));
  return !inside.empty() && *inside.begin() != "..";
}

void requireUsableRequest(const PhotoRunOptions& options) {
  std::error_code status;
  const bool isFile = fs::is_regular_file(options.photos, status);
  if (!isFile && !fs::is_directory(options.photos, status))
    throw Error(options.photos.string(), "", "is neither a folder nor a file", "name a folder of photos, or a video");
  if (!isFile && options.frames > 0)
    throw Error("--frames", "", "concerns videos, and this is a folder", "leave it out, or name a video");
  if (liesIn(options.out, options.photos)) {
    throw Error(options.out.string(), "", "is the folder of photos, or in it: its pictures would be taken for photos",
                "name another folder to write to");
  }
  // Captures and models name paths as JSON does.
  if (!isUtf8(fs::absolute(options.out).string()))
    throw Error(options.out.string(), "", "is a path that is not UTF-8", "name another folder to write to");
  checkHoldOut(options.holdout);
  for (const char* name : {"frames", "poses", "capture", "model", "scene", "probe", "logs", "report.html",
                           "evaluation.html", "eval.json"}) {
    if (!fs::exists(options.out / name, status) || fs::exists(options.out / "run.json", status)) continue;
    throw Error((options.out / name).string(), "", "was not made by such a run, and would be replaced",
                "name another folder to write to");
  }
}

RunRequest describeRequest(const PhotoRunOptions& options) {
  RunRequest request;
  request.flags = describeFlags(options);
  request.command = fmt::format("run {} {}", options.photos.string(), options.out.string());
  for (const auto& [flag, value] : request.flags) request.command += " " + flag + " " + value;
  if (options.threads > 0) request.command += fmt::format(" --threads {}", options.threads);
  if (!options.range.from.empty()) request.command += " --from " + options.range.from;
  if (!options.range.until.empty()) request.command += " --until " + options.range.until;
  return request;
}

std::string describeHoldOut(const std::string& rule) {
  if (!rule.starts_with(kListOfHeldOut)) return rule;
  return "list " + textDigest(readTextFile(rule.substr(kListOfHeldOut.size())));
}

void adoptEarlierFlags(PhotoRunOptions& options, const std::set<std::string>& given) {
  const auto now = describeFlags(options);
  const auto earlier = readFlags(options.out);
  if (earlier.empty()) return;
  const bool isLengthGiven = given.contains("--minutes") || given.contains("--steps");
  PhotoRunOptions adopted = options;
  for (const auto& [flag, value] : earlier) {
    const bool isLength = flag == "--minutes" || flag == "--steps";
    if (given.contains(flag) || (isLength && isLengthGiven)) continue;
    if (flag == "--frames" && fs::is_directory(options.photos)) continue;  // of a video, once
    if (!setFlag(adopted, flag, value)) {
      throw Error((options.out / "run.json").string(), "flags",
                  fmt::format("{} is no value of {}", value.empty() ? "an empty text" : value, flag),
                  fmt::format("give {}", flag));
    }
  }
  const auto flags = describeFlags(adopted);
  std::string same;
  for (const auto& [flag, value] : flags) {
    const auto before = now.find(flag);
    if (before == now.end() || before->second != value) same += fmt::format(" {} {}", flag, value);
  }
  if (!same.empty()) inform("as before in {}:{}", options.out.string(), same);
  options = std::move(adopted);
}

}  // namespace tessera
