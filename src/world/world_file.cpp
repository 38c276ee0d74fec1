#include "world/world_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "base/error.h"
#include "base/text_place.h"
#include "tiles/json_fields.h"
#include "world/world_text.h"

namespace tessera {
namespace {

using nlohmann::json;

constexpr uint64_t kEmbeddedBytes = 128'000'000;                            // of all embedded files
constexpr uint64_t kWorldBytes = kEmbeddedBytes + kEmbeddedBytes / 10 * 4;  // of the file itself
constexpr size_t kMaxScenes = 16, kMaxModels = 1000, kMaxBookmarks = 200;
constexpr size_t kMaxFilesOfModel = 1000, kMaxFiles = 4000;
constexpr size_t kNameLength = 1000;
constexpr double kFarthestInWorld = 1e7, kSmallestScale = 1e-6, kLargestScale = 1e6;
constexpr const char* kCorrect = "correct it, or save it in the viewer again";

// An object in the file with its place, for errors.
class Entry {
 public:
  Entry(const json& object, const std::string& file, std::string place)
      : object_(object), file_(file), place_(std::move(place)) {
    if (!object_.is_object()) refuse("", "is not an object");
  }

  [[noreturn]] void refuse(const std::string& key, const std::string& reason) const {
    throw Error(file_, key.empty() ? place_ : place_ + "." + key, reason, kCorrect);
  }
  bool has(const char* key) const { return json_fields::getField(object_, key) != nullptr; }
  std::string text(const char* key) const {  // empty if it is missing or no text
    const std::string* text = json_fields::getString(object_, key);
    if (text != nullptr && countCharacters(*text) > kNameLength) refuse(key, "is too long");
    return text == nullptr ? "" : *text;
  }
  std::string name() const {
    std::string name = text("name");
    if (name.empty()) refuse("name", "is missing");
    return name;
  }
  double number(const char* key, double maximum) const {
    const auto number = json_fields::getNumber(object_, key);
    if (!number) refuse(key, "is not a number");
    if (std::abs(*number) > maximum) refuse(key, fmt::format("is beyond {}", maximum));
    return *number;
  }
  std::vector<double> numbers(const char* key, size_t count, double maximum) const {
    const json* array = json_fields::getArray(object_, key);
    if (array == nullptr || array->size() != count) refuse(key, fmt::format("is not {} numbers", count));
    std::vector<double> numbers;
    for (const json& value : *array) {
      const auto number = json_fields::numberFrom(value);
      if (!number) refuse(key, fmt::format("is not {} numbers", count));
      if (std::abs(*number) > maximum) refuse(key, fmt::format("has a number beyond {}", maximum));
      numbers.push_back(*number);
    }
    return numbers;
  }
  Vec3d vector(const char* key, double maximum = kFarthestInWorld) const {
    return Eigen::Map<const Vec3d>(numbers(key, 3, maximum).data());
  }
  Vec3d sizes(const char* key) const {
    const Vec3d sizes = vector(key, kLargestScale);
    if (sizes.minCoeff() < kSmallestScale) refuse(key, fmt::format("is not above {}", kSmallestScale));
    return sizes;
  }
  Mat3d rotation() const {
    const std::vector<double> q = numbers("rotation", 4, 1.01);
    const Eigen::Quaterniond quaternion(q[3], q[0], q[1], q[2]);
    if (std::abs(quaternion.norm() - 1) > 0.01) refuse("rotation", "is not a rotation");
    return quaternion.normalized().toRotationMatrix();
  }
  bool isOn(const char* key) const { return json_fields::getBoolean(object_, key).value_or(true); }
  const json* list(const char* key) const { return json_fields::getArray(object_, key); }

 private:
  const json& object_;
  const std::string& file_;
  std::string place_;
};

WorldScene readScene(const Entry& entry) {
  WorldScene scene;
  scene.name = entry.text("name");
  scene.url = entry.text("url");
  if (hasOtherScheme(scene.url)) entry.refuse("url", "is neither an address of http or https nor a relative one");
  scene.isVisible = entry.isOn("visible");
  if (!entry.has("position") && !entry.has("rotation") && !entry.has("scale")) return scene;
  Placement& placement = scene.placement.emplace();
  if (entry.has("position")) placement.position = entry.vector("position");
  if (entry.has("rotation")) placement.rotation = entry.rotation();
  if (entry.has("scale")) {
    placement.scale = entry.number("scale", kLargestScale);
    if (placement.scale < kSmallestScale) entry.refuse("scale", fmt::format("is not above {}", kSmallestScale));
  }
  return scene;
}

WorldModel readModelEntry(const Entry& entry) {
  WorldModel model;
  const json* files = entry.list("files");
  if (files == nullptr || files->empty() || files->size() > kMaxFilesOfModel) {
    entry.refuse("files", "names no files, or too many");
  }
  for (const json& file : *files) {
    if (!file.is_string()) entry.refuse("files", "has an invalid name");
    const std::string& name = file.get_ref<const std::string&>();
    const bool isOther = hasOtherScheme(name) || name.starts_with("//") || name.starts_with("\\\\");
    if (name.empty() || countCharacters(name) > kNameLength || isOther) entry.refuse("files", "has an invalid name");
    model.files.push_back(name);
  }
  if (const json* contents = entry.list("contents")) {
    const bool areTexts = std::all_of(contents->begin(), contents->end(), [](const json& x) { return x.is_string(); });
    if (contents->size() > files->size() || !areTexts) entry.refuse("contents", "is not one text for each file");
  }
  model.name = entry.name();
  model.position = entry.vector("position");
  model.rotation = entry.rotation();
  model.scale = entry.sizes("scale");
  model.isVisible = entry.isOn("visible");
  return model;
}

HiddenBox readHiddenBox(const Entry& entry) {
  HiddenBox box;
  box.name = entry.name();
  box.middle = entry.vector("middle");
  box.size = entry.sizes("size");
  if (entry.has("turn")) box.turn = entry.number("turn", 1000);
  box.hides = entry.isOn("hides");
  return box;
}

std::optional<double> parseNumber(std::string_view text) {
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(number)) return std::nullopt;
  return number;
}

bool parsePlace(std::string_view text, Vec3d& place) {
  for (int axis = 0; axis < 3; ++axis) {
    const size_t end = text.find(',');
    if ((end == std::string_view::npos) != (axis == 2)) return false;
    const auto number = parseNumber(trimmed(text.substr(0, end)));
    if (!number || std::abs(*number) >= 1e9) return false;
    place[axis] = *number;
    if (axis < 2) text.remove_prefix(end + 1);
  }
  return true;
}

// Parses "eye=x,y,z&target=x,y,z&fov=degrees", in which '+' stands for a space.
bool parseView(const std::string& address, Bookmark& bookmark) {
  bool hasEye = false, hasTarget = false;
  std::string spaced = address;
  std::replace(spaced.begin(), spaced.end(), '+', ' ');
  const std::string plain = decodePercent(spaced);
  std::string_view rest = plain;
  if (rest.starts_with('#')) rest.remove_prefix(1);
  while (!rest.empty()) {
    const std::string_view word = rest.substr(0, rest.find('&'));
    rest.remove_prefix(std::min(rest.size(), word.size() + 1));
    if (word.starts_with("eye=")) hasEye = parsePlace(word.substr(4), bookmark.eye);
    if (word.starts_with("target=")) hasTarget = parsePlace(word.substr(7), bookmark.target);
    if (!word.starts_with("fov=")) continue;
    const double degrees = parseNumber(trimmed(word.substr(4))).value_or(0);
    if (degrees >= 5 && degrees <= 120) bookmark.fieldOfView = degrees;
  }
  return hasEye && hasTarget && (bookmark.eye - bookmark.target).norm() >= 1e-6;
}

Bookmark readBookmark(const Entry& entry) {
  Bookmark bookmark;
  if (!parseView(entry.text("view"), bookmark)) {
    entry.refuse("view", "is not a view such as eye=x,y,z&target=x,y,z");
  }
  bookmark.name = entry.name();
  return bookmark;
}

template <class Read>
auto readList(const json& world, const char* key, bool isNeeded, size_t maximum, const std::string& file, Read read) {
  std::vector<decltype(read(std::declval<const Entry&>()))> all;
  const json* field = json_fields::getField(world, key);
  if (field == nullptr && !isNeeded) return all;
  if (field == nullptr || !field->is_array()) throw Error(file, key, "is not a list", kCorrect);
  if (field->size() > maximum) throw Error(file, key, fmt::format("are more than {}", maximum), "keep fewer");
  for (size_t i = 0; i < field->size(); ++i)
    all.push_back(read(Entry((*field)[i], file, fmt::format("{}[{}]", key, i))));
  return all;
}

std::map<std::string, Bytes> readFiles(const json& world, const std::string& file) {
  std::map<std::string, Bytes> files;
  const json* field = json_fields::getField(world, "files");
  if (field == nullptr) return files;
  if (!field->is_object()) throw Error(file, "files", "is not an object", kCorrect);
  uint64_t bytes = 0;
  for (const auto& [name, text] : field->items()) {
    const std::string place = fmt::format("files[\"{}\"]", name.substr(0, 100));
    if (name.empty() || countCharacters(name) > kNameLength || files.size() == kMaxFiles) {
      throw Error(file, place, "is one file too many, or has no name", kCorrect);
    }
    if (!text.is_string()) throw Error(file, place, "is not text", kCorrect);
    auto content = decodeBase64(text.get_ref<const std::string&>());
    if (!content) throw Error(file, place, "is not base64", kCorrect);
    bytes += content->size();
    if (bytes > kEmbeddedBytes) {
      throw Error(file, place, fmt::format("is beyond {} MB of models", kEmbeddedBytes / 1'000'000),
                  "save the world without its models");
    }
    files.emplace(name, std::move(*content));
  }
  return files;
}

// Version 1 had a single scene, which may have no address.
std::vector<WorldScene> readFirstVersion(const json& world) {
  WorldScene scene;
  if (const json* field = json_fields::getField(world, "scene")) {
    if (const std::string* name = json_fields::getString(*field, "name")) scene.name = name->substr(0, kNameLength);
    const std::string* url = json_fields::getString(*field, "url");
    if (url != nullptr && countCharacters(*url) <= kNameLength && !hasOtherScheme(*url)) scene.url = *url;
  }
  return {scene};
}

}  // namespace

World decodeWorld(std::string_view text, const std::string& file) {
  if (text.size() > kWorldBytes) {
    throw Error(file, "", "is larger than 179.2 MB", "save it without its models");
  }
  json parsed;
  try {
    parsed = json::parse(text);
  } catch (const json::parse_error& error) {
    throw Error(file, placeInText(text, error.byte), "is not JSON", kCorrect);
  } catch (const json::out_of_range&) {
    throw Error(file, "", "contains a number that is too large", kCorrect);
  }
  if (!json_fields::isString(parsed, "kind", "tessera world")) {
    throw Error(file, "kind", "is not 'tessera world'", "name a world.json, or the folder of a scene or of a model");
  }
  const auto version = json_fields::getNumber(parsed, "version");
  if (version != 1 && version != 2) {
    throw Error(file, "version", "is neither 1 nor 2", "correct it, or use a newer tessera");
  }
  World world;
  world.scenes =
      version == 1 ? readFirstVersion(parsed) : readList(parsed, "scenes", true, kMaxScenes, file, readScene);
  if (std::all_of(world.scenes.begin(), world.scenes.end(), [](const WorldScene& x) { return x.placement; })) {
    throw Error(file, "scenes", "contains no scene without a placement, which would define the frame of the world",
                "leave out position, rotation and scale of one");
  }
  world.models = readList(parsed, "models", version == 1, kMaxModels, file, readModelEntry);
  world.hidden = readList(parsed, "hidden", false, kMaxHiddenBoxes, file, readHiddenBox);
  world.bookmarks = readList(parsed, "bookmarks", false, kMaxBookmarks, file, readBookmark);
  world.files = readFiles(parsed, file);
  return world;
}

World readWorldFile(const fs::path& file) {
  return decodeWorld(readTextFile(file, kWorldBytes), file.string());
}

std::optional<fs::path> findWorldFile(const fs::path& path) {
  std::error_code status;
  if (fs::is_regular_file(path, status) && path.extension() == ".json") return path;
  if (fs::is_regular_file(path / "tileset.json", status)) return std::nullopt;
  if (fs::is_regular_file(path / "world.json", status)) return path / "world.json";
  return std::nullopt;
}

fs::path resolveScene(const fs::path& worldFile, const WorldScene& scene, const std::string& place) {
  const auto refuse = [&](const std::string& reason, const std::string& remedy) {
    throw Error(worldFile.string(), place + ".url", reason, remedy);
  };
  const std::string& url = scene.url;
  if (url.empty()) refuse("is missing", "name the folder of the scene");
  if (isOfNetwork(url) || url.starts_with('/')) {
    refuse(fmt::format("'{}' is not relative to the file's folder, and only browsers fetch scenes", url.substr(0, 200)),
           "download the scene and name its folder, or open the world with tessera serve");
  }
  fs::path folder = worldFile.parent_path() / decodePercent(url.substr(0, url.find_first_of("?#")));
  if (folder.filename() == "tileset.json") folder = folder.parent_path();
  std::error_code status;
  if (!fs::is_regular_file(folder / "tileset.json", status)) {
    refuse(fmt::format("there is no scene in '{}'", folder.lexically_normal().string()),
           "correct the address, or put the scene there");
  }
  return folder;
}

}  // namespace tessera
