#include "representations/methods.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "representations/list.h"
#include "train/run_folder.h"

namespace tessera {

#define METHOD(name, Name) const Method& name##Method();
TESSERA_REPRESENTATIONS(METHOD, METHOD)
#undef METHOD

std::span<const Method* const> methods() {
#define METHOD(name, Name) &name##Method(),
  static const Method* const kMethods[] = {TESSERA_REPRESENTATIONS(METHOD, METHOD)};
#undef METHOD
  return kMethods;
}

const Method* findMethod(std::string_view name) {
  const auto all = methods();
  const auto it = std::find_if(all.begin(), all.end(), [&](const Method* method) { return method->name == name; });
  return it == all.end() ? nullptr : *it;
}

const Method& findModelMethod(const ModelFolder& model) {
  return findModelMethod(model, requireManifest(model));
}

const Method& findModelMethod(const ModelFolder& model, const ModelManifest& manifest) {
  if (const Method* method = findMethod(manifest.method)) return *method;
  throw Error((model.root() / "manifest.json").string(), "method",
              "'" + manifest.method + "' is not a method that this tessera knows",
              "restore the file, or use a newer tessera");
}

std::unique_ptr<MethodSettings> savedSettings(const Method& method, const fs::path& model) {
  std::unique_ptr<MethodSettings> settings = method.settings("");
  const ModelFolder folder(model);
  if (fs::exists(folder.configPath())) configFromToml(settings->fields(), folder.configPath());
  return settings;
}

std::vector<SurfaceCoverage> readCoverage(const Method& method, const fs::path& model) {
  return method.readCoverage != nullptr ? method.readCoverage(model) : std::vector<SurfaceCoverage>();
}

const Method& firstMethod(bool (*has)(const Method&)) {
  const auto all = methods();
  const auto it = std::find_if(all.begin(), all.end(), [&](const Method* method) { return has(*method); });
  CHECK(it != all.end());
  return **it;
}

std::string namesOfMethods(bool (*have)(const Method&), std::string_view conjunction) {
  std::vector<std::string_view> names;
  for (const Method* method : methods()) {
    if (have(*method)) names.push_back(method->name);
  }
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 < names.size() ? std::string(", ") : fmt::format(" {} ", conjunction);
    text += names[i];
  }
  return text;
}

}  // namespace tessera
