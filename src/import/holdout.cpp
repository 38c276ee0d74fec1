#include "import/holdout.h"

#include <charconv>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "base/log.h"

namespace tessera {
namespace {

constexpr const char* kRemedy = "use every:N (N at least 2), list:FILE or none";

void holdOutList(const fs::path& file, std::vector<Photo>& photos) {
  const std::string text = readTextFile(file);
  std::set<std::string> names;
  for (size_t at = 0; at < text.size();) {
    const size_t end = std::min(text.find('\n', at), text.size());
    std::string line = text.substr(at, end - at);
    at = end + 1;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    if (!line.empty() && line[0] != '#') names.insert(line);
  }
  std::set<std::string> found;
  for (Photo& photo : photos) {
    const fs::path path(photo.name);
    const std::string withoutExtension = fs::path(path).replace_extension("").generic_string();
    for (const std::string& candidate :
         {photo.name, path.filename().string(), path.stem().string(), withoutExtension}) {
      if (names.contains(candidate)) {
        photo.split = Split::test;
        found.insert(candidate);
      }
    }
  }
  // Names are often written with the extension that the photo had before it was reduced.
  for (const std::string& name : names) {
    if (found.contains(name)) continue;
    const std::string stem = fs::path(name).stem().string();
    bool matched = false;
    for (Photo& photo : photos) {
      if (fs::path(photo.name).stem() != stem || !fs::path(name).has_extension()) continue;
      photo.split = Split::test;
      matched = true;
    }
    if (!matched) warn("{}: {} is not a photo of this capture", file.string(), name);
  }
}

}  // namespace

void holdOut(const std::string& rule, std::vector<Photo>& photos) {
  for (Photo& photo : photos) photo.split = Split::train;
  if (rule == "none") return;
  if (rule.starts_with("every:")) {
    size_t step = 0;
    const char* end = rule.data() + rule.size();
    const auto [last, error] = std::from_chars(rule.data() + 6, end, step);
    if (error != std::errc() || last != end || step < 2) throw Error("--holdout", rule, "is not a step", kRemedy);
    for (size_t i = 0; i < photos.size(); i += step) photos[i].split = Split::test;
  } else if (rule.starts_with("list:")) {
    holdOutList(rule.substr(5), photos);
  } else {
    throw Error("--holdout", rule, "is not a rule", kRemedy);
  }
  for (const Photo& photo : photos) {
    if (photo.split == Split::train) return;
  }
  throw Error("--holdout", rule, "holds out every photo", "leave some to train on");
}

}  // namespace tessera
