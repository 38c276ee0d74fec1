#include "serve/world_file.h"

#include <fmt/format.h>

#include <cctype>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "serve/http_request.h"
#include "serve/site_file.h"

namespace tessera {
namespace {

using nlohmann::json;

constexpr uint64_t kMostBytes = 180'000'000;  // with the models that it holds

// Of a whole address, or one of another server.
bool isElsewhere(const std::string& url) {
  size_t end = 0;
  while (end < url.size() && (std::isalnum(static_cast<unsigned char>(url[end])) || url[end] == '+' ||
                              url[end] == '-' || url[end] == '.')) {
    ++end;
  }
  const bool hasScheme = end > 0 && end < url.size() && url[end] == ':';
  return hasScheme || url.starts_with("//");
}

// Of its tileset.json, seen from the folder; nothing where it leads out.
std::optional<std::string> pathOfScene(const std::string& url) {
  if (url.starts_with('/')) return std::nullopt;
  const std::string plain = fs::path(url.substr(0, url.find_first_of("?#"))).lexically_normal().generic_string();
  auto path = pathOfTarget("/" + (plain == "." || plain == "./" ? "" : plain));
  if (!path) return std::nullopt;
  if (!path->ends_with(".json")) *path += path->ends_with('/') ? "tileset.json" : "/tileset.json";
  return path->substr(1);
}

json readWorld(const fs::path& file) {
  const auto withoutFiles = [](int depth, json::parse_event_t event, json& parsed) {
    return !(depth == 1 && event == json::parse_event_t::key && parsed == "files");
  };
  json world = json::parse(readTextFile(file, kMostBytes), withoutFiles, false);
  if (!world.is_object()) throw Error(file.string(), "", "is not JSON", "save it in the viewer again");
  if (!world.contains("kind") || world["kind"] != "tessera world") {
    throw Error(file.string(), "", "is no world of the viewer", "name a world.json that it has saved, or a scene");
  }
  return world;
}

// Percent-encoded, whatever it holds.
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

// Throws Error where a server of the folder would not give the world itself away.
void requireServed(const fs::path& worldFile, const fs::path& folder) {
  const std::string name = worldFile.filename().string();
  if (!pathOfTarget("/" + encoded(name))) {
    throw Error(worldFile.string(), "", "has a name by which nothing is served",
                "give it one that does not begin with a dot, and has no backslash or control character");
  }
  if (!SiteFile::open(folder, name).file) {
    throw Error(
        worldFile.string(), "",
        fmt::format("is a link to a file outside of '{}', or to a hidden one, which is not served", folder.string()),
        "copy it there, or name the file that it leads to");
  }
}

// Not empty where it says one.
std::string urlOf(const json& scene) {
  if (!scene.is_object() || !scene.contains("url") || !scene["url"].is_string()) return "";
  return scene["url"].get<std::string>();
}

}  // namespace

std::optional<fs::path> worldFileAt(const fs::path& path) {
  std::error_code status;
  if (fs::is_regular_file(path, status) && path.extension() == ".json") return path;
  if (fs::is_regular_file(path / "tileset.json", status)) return std::nullopt;
  if (fs::is_regular_file(path / "world.json", status)) return path / "world.json";
  return std::nullopt;
}

void requireScenesBeside(const fs::path& worldFile) {
  const json world = readWorld(worldFile);
  const fs::path folder = fs::canonical(fs::absolute(worldFile).parent_path());
  requireServed(worldFile, folder);
  const auto require = [&](const json& scene, const std::string& place) {
    const std::string url = urlOf(scene);
    if (url.empty() || isElsewhere(url)) return;
    const auto path = pathOfScene(url);
    const auto file = path ? SiteFile::open(folder, *path).file : nullptr;
    if (file) return;
    std::error_code status;
    const bool isMissing = path && !fs::exists(folder / *path, status);
    throw Error(worldFile.string(), place,
                isMissing ? fmt::format("there is no '{}' in '{}'", *path, folder.string())
                          : fmt::format("'{}' does not lie in '{}', and nothing else is served", url, folder.string()),
                isMissing ? "correct the address, or put the scene there"
                          : "put the scene into that folder, or world.json into one above both");
  };
  if (world.contains("scene")) require(world["scene"], "scene.url");
  if (!world.contains("scenes") || !world["scenes"].is_array()) return;
  for (size_t i = 0; i < world["scenes"].size(); ++i) {
    const json& scene = world["scenes"][i];
    const std::string place = fmt::format("scenes[{}]", i);
    if (!scene.is_object()) throw Error(worldFile.string(), place, "is no object", "save it in the viewer again");
    require(scene, place + ".url");
  }
}

std::string viewerOfWorld(const std::string& name) {
  // Once for the path that it is part of, and once for the query that holds the path.
  return "?world=world/" + encoded(encoded(name));
}

}  // namespace tessera
