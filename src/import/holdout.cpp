#include "import/holdout.h"

#include <algorithm>
#include <charconv>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"
#include "import/clean.h"

namespace tessera {
namespace {

constexpr const char* kRemedy = "use every:N (N at least 2), list:FILE or none";

std::string withoutExtension(fs::path path) {
  return path.replace_extension("").generic_string();
}

// Returns a path as it is within the folder of images.
fs::path innerPath(const fs::path& path) {
  return path.has_parent_path() && *path.begin() == "images" ? path.lexically_relative("images") : path;
}

void holdOutList(const fs::path& file, std::vector<Photo>& photos) {
  const std::string text = readTextFile(file);
  std::set<std::string> names;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size());
    std::string line = text.substr(at, end - at);
    at = end + 1;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    if (!line.empty() && line[0] != '#') names.insert(fs::path(line).lexically_normal().generic_string());
  }
  std::set<std::string> matchedNames;
  for (Photo& photo : photos) {
    const fs::path path(photo.name), inner = innerPath(path);
    for (const std::string& candidate : {photo.name, inner.generic_string(), path.filename().string(),
                                         path.stem().string(), withoutExtension(path), withoutExtension(inner)}) {
      if (names.contains(candidate)) {
        photo.split = Split::test;
        matchedNames.insert(candidate);
      }
    }
  }
  // Lists often give names with the extension that the photo had before it was downscaled, and folders that it was in.
  std::vector<std::string> strangers;
  for (const std::string& name : names) {
    if (matchedNames.contains(name)) continue;
    const fs::path listed(name);
    std::vector<Photo*> sameStem, samePath;
    for (Photo& photo : photos) {
      const fs::path path(photo.name);
      if (path.stem() != listed.stem() || !listed.has_extension()) continue;
      sameStem.push_back(&photo);
      if (withoutExtension(innerPath(path)) == withoutExtension(innerPath(listed))) samePath.push_back(&photo);
    }
    // Photos of several flights may have the same number: then a folder tells which of them is named.
    const bool saysFolder = listed.has_parent_path();
    const std::vector<Photo*>& named = !samePath.empty() || (saysFolder && sameStem.size() > 1) ? samePath : sameStem;
    for (Photo* photo : named) photo->split = Split::test;
    if (named.empty()) strangers.push_back(name);
  }
  if (strangers.empty()) return;
  if (strangers.size() == names.size()) {
    throw Error(file.string(), "", "names no photo of this capture (" + abbreviateList(strangers) + ")",
                "write one photo's name a line");
  }
  warn("{}: {} of {} names are not photos of this capture ({})", file.string(), strangers.size(), names.size(),
       abbreviateList(strangers));
}

// Returns the N of every:N.
size_t parseHoldoutStep(const std::string& rule) {
  size_t step = 0;
  const char* end = rule.data() + rule.size();
  const auto [last, error] = std::from_chars(rule.data() + 6, end, step);
  if (error != std::errc() || last != end || step < 2) throw Error("--holdout", rule, "is not a step", kRemedy);
  return step;
}

}  // namespace

void checkHoldOut(const std::string& rule) {
  if (rule == "auto" || rule == "none") return;
  if (rule.starts_with("every:")) {
    parseHoldoutStep(rule);
  } else if (rule.starts_with("list:")) {
    readTextFile(rule.substr(5));
  } else {
    throw Error("--holdout", rule, "is not a rule", kRemedy);
  }
}

void holdOut(const std::string& rule, std::vector<Photo>& photos) {
  checkHoldOut(rule);
  for (Photo& photo : photos) photo.split = Split::train;
  if (rule == "none") return;
  if (rule.starts_with("every:")) {
    for (size_t i = 0, step = parseHoldoutStep(rule); i < photos.size(); i += step) photos[i].split = Split::test;
  } else {
    holdOutList(rule.substr(5), photos);
  }
  for (const Photo& photo : photos) {
    if (photo.split == Split::train) return;
  }
  throw Error("--holdout", rule, "holds out every photo", "leave some to train on");
}

void chooseSplit(SourceCapture& source, const std::string& rule) {
  std::vector<Photo>& photos = source.capture.photos;
  if (rule != "auto") return holdOut(rule, photos);
  const auto has = [&photos](Split split) {
    return std::any_of(photos.begin(), photos.end(), [split](const Photo& photo) { return photo.split == split; });
  };
  if (!source.hasOwnSplit || !has(Split::train)) {
    if (source.hasOwnSplit) warn("the source's own split leaves nothing to train on; it is not used");
    holdOut(photos.size() > 1 ? "every:8" : "none", photos);
  } else if (!has(Split::test)) {
    for (Photo& photo : photos) {
      if (photo.split == Split::validation) photo.split = Split::test;
    }
  }
  if (!has(Split::test)) {
    warn("no photo is held out, so there is nothing to measure with; --holdout every:8 holds out every 8th");
  }
}

}  // namespace tessera
