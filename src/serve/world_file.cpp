#include "serve/world_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text_place.h"
#include "serve/http_request.h"
#include "serve/site_file.h"

namespace tessera {
namespace {

using nlohmann::json;

constexpr uint64_t kMaxBytes = 180'000'000;  // including embedded models
constexpr size_t kMaxScenes = 16;
constexpr const char* kCorrect = "correct it, or save it in the viewer again";

// Returns whether an address has a scheme or names another server.
bool isElsewhere(const std::string& url) {
  size_t end = 0;
  while (end < url.size() && (std::isalnum(static_cast<unsigned char>(url[end])) || url[end] == '+' ||
                              url[end] == '-' || url[end] == '.')) {
    ++end;
  }
  const bool hasScheme = end > 0 && end < url.size() && url[end] == ':';
  return hasScheme || url.starts_with("//");
}

// Returns the path of a scene's tileset.json relative to the folder; nothing if it leads outside.
std::optional<std::string> pathOfScene(const std::string& url) {
  if (url.starts_with('/')) return std::nullopt;
  const std::string plain = fs::path(url.substr(0, url.find_first_of("?#"))).lexically_normal().generic_string();
  auto path = pathOfTarget("/" + (plain == "." || plain == "./" ? "" : plain));
  if (!path) return std::nullopt;
  if (!path->ends_with(".json")) *path += path->ends_with('/') ? "tileset.json" : "/tileset.json";
  return path->substr(1);
}

// Returns the value of a field, or null if the object does not have it.
const json& fieldOrNull(const json& object, const char* key) {
  static const json kNone;
  const auto entry = object.find(key);
  return entry == object.end() ? kNone : *entry;
}

json readWorld(const fs::path& file) {
  const std::string text = readTextFile(file, kMaxBytes);
  json world;
  try {
    world = json::parse(text);
  } catch (const json::parse_error& error) {
    throw Error(file.string(), placeInText(text, error.byte), "is not JSON", kCorrect);
  } catch (const json::out_of_range&) {
    throw Error(file.string(), "", "contains a number that is too large", kCorrect);
  }
  if (fieldOrNull(world, "kind") != "tessera world") {
    throw Error(file.string(), "kind", "is not 'tessera world'",
                "correct it, or name another world, or the folder of a scene");
  }
  return world;
}

// Percent-encodes everything but ASCII letters, digits, '-', '.' and '_'.
std::string encoded(const std::string& text) {
  std::string code;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isalnum(byte) || c == '-' || c == '.' || c == '_') {
      code += c;
    } else {
      code += fmt::format("%{:02X}", byte);
    }
  }
  return code;
}

// Throws Error if a server of the folder would not serve the world file itself.
void requireServed(const fs::path& worldFile, const fs::path& folder) {
  const std::string name = worldFile.filename().string();
  if (!pathOfTarget("/" + encoded(name))) {
    throw Error(worldFile.string(), "", "has a name that the server does not serve",
                "give it one that does not begin with a dot, and has no backslash or control character");
  }
  if (!SiteFile::open(folder, name).file) {
    throw Error(
        worldFile.string(), "",
        fmt::format("is a link to a file outside of '{}', or to a hidden one, which is not served", folder.string()),
        "copy it there, or name the file that it leads to");
  }
}

bool areNumbers(const json& value, size_t count) {
  return value.is_array() && value.size() == count &&
         std::all_of(value.begin(), value.end(), [](const json& one) { return one.is_number(); });
}

// Returns whether the scene is placed relative to the main scene's world. Throws Error if its placement is malformed.
bool isPlaced(const json& scene, const fs::path& file, const std::string& place) {
  const auto require = [&](const char* key, bool isRight, const char* reason) {
    if (!isRight) throw Error(file.string(), place + "." + key, reason, kCorrect);
  };
  const auto has = [&](const char* key) { return scene.contains(key); };
  require("position", !has("position") || areNumbers(scene["position"], 3), "is not 3 numbers");
  require("rotation", !has("rotation") || areNumbers(scene["rotation"], 4), "is not 4 numbers");
  require("scale", !has("scale") || scene["scale"].is_number(), "is not a number");
  return has("position") || has("rotation") || has("scale");
}

// Returns the scenes with their locations in the file, for errors. Throws Error if the viewer would not open them.
std::vector<std::pair<std::string, const json*>> listScenes(const json& world, const fs::path& file) {
  const json &version = fieldOrNull(world, "version"), &list = fieldOrNull(world, "scenes");
  if (version == 1) return {{"scene", &fieldOrNull(world, "scene")}};
  const auto refuse = [&](const std::string& place, const std::string& reason, const std::string& remedy) {
    throw Error(file.string(), place, reason, remedy);
  };
  if (version != 2) refuse("version", "is neither 1 nor 2", "correct it, or use a newer tessera");
  if (!list.is_array() || list.empty()) {
    refuse("scenes", list.is_array() ? "is empty" : "is missing, or not a list",
           R"(name one at least: [{"url": "garden.scene"}])");
  }
  if (list.size() > kMaxScenes) refuse("scenes", fmt::format("are more than {}", kMaxScenes), "keep fewer");
  std::vector<std::pair<std::string, const json*>> scenes;
  bool hasMain = false;
  for (const json& scene : list) {
    const std::string place = fmt::format("scenes[{}]", scenes.size());
    if (!scene.is_object()) refuse(place, "is not an object", kCorrect);
    if (!isPlaced(scene, file, place)) hasMain = true;
    scenes.emplace_back(place, &scene);
  }
  if (!hasMain) {
    refuse("scenes", "contains no scene without a placement, which would define the frame of the world",
           "leave out position, rotation and scale of one");
  }
  return scenes;
}

// Returns the address of the scene; empty if it has none.
std::string readSceneUrl(const json& scene) {
  const json& url = fieldOrNull(scene, "url");
  return url.is_string() ? url.get<std::string>() : "";
}

}  // namespace

std::optional<fs::path> worldFileAt(const fs::path& path) {
  std::error_code status;
  if (fs::is_regular_file(path, status) && path.extension() == ".json") return path;
  if (fs::is_regular_file(path / "tileset.json", status)) return std::nullopt;
  if (fs::is_regular_file(path / "world.json", status)) return path / "world.json";
  return std::nullopt;
}

void requireWorld(const fs::path& worldFile) {
  const json world = readWorld(worldFile);
  const fs::path folder = fs::canonical(fs::absolute(worldFile).parent_path());
  requireServed(worldFile, folder);
  for (const auto& [place, scene] : listScenes(world, worldFile)) {
    const std::string url = readSceneUrl(*scene);
    if (url.empty() || isElsewhere(url)) continue;
    const auto path = pathOfScene(url);
    if (path && SiteFile::open(folder, *path).file) continue;
    std::error_code status;
    const bool isMissing = path && !fs::exists(folder / *path, status);
    throw Error(worldFile.string(), place + ".url",
                isMissing ? fmt::format("there is no '{}' in '{}'", *path, folder.string())
                          : fmt::format("'{}' does not lie in '{}', and nothing else is served", url, folder.string()),
                isMissing ? "correct the address, or put the scene there"
                          : "put the scene into that folder, or world.json into one above both");
  }
}

std::string viewerOfWorld(const std::string& name) {
  // Encoded twice: once as part of a path, and once because the path is part of a query.
  return "?world=world/" + encoded(encoded(name));
}

}  // namespace tessera
