// Reads world.json (docs/world-format.md): which scenes and models stand where, what is hidden, and bookmarked views.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "scene/axes.h"

namespace tessera {

inline constexpr size_t kMaxHiddenBoxes = 8;

// A similarity: x_world = position + scale · rotation · x.
struct Placement {
  Vec3d position = Vec3d::Zero();
  Mat3d rotation = Mat3d::Identity();
  double scale = 1;
};

struct WorldScene {
  std::string name;
  std::string url;                     // address of its tileset.json or of its folder; may be empty
  std::optional<Placement> placement;  // of the world of its capture; a main scene has none
  bool isVisible = true;
};

struct WorldModel {
  std::string name;
  std::vector<std::string> files;  // the model's own file first, then those that it needs; at least one
  Vec3d position = Vec3d::Zero();
  Mat3d rotation = Mat3d::Identity();
  Vec3d scale = Vec3d::Ones();  // along the axes of the world before the rotation
  bool isVisible = true;
};

struct HiddenBox {
  std::string name;
  Vec3d middle = Vec3d::Zero(), size = Vec3d::Ones();
  double turn = 0;  // radians about the vertical axis, anticlockwise as seen from above
  bool hides = true;
};

struct Bookmark {
  std::string name;
  Vec3d eye = Vec3d::UnitX(), target = Vec3d::Zero();
  double fieldOfView = 50;  // degrees, vertical
};

struct World {
  std::vector<WorldScene> scenes;  // at least one, of which one has no placement
  std::vector<WorldModel> models;
  std::vector<HiddenBox> hidden;
  std::vector<Bookmark> bookmarks;
  std::map<std::string, Bytes> files;  // embedded files of models, by name
};

// Throws Error that names `file` and the first invalid place in it.
World decodeWorld(std::string_view text, const std::string& file);
World readWorldFile(const fs::path& file);

// Returns the world file that a path names: itself, or world.json in that folder; nothing if there is none.
std::optional<fs::path> findWorldFile(const fs::path& path);

// Returns the folder of a scene, relative to that of the world file. Throws Error if the address is none of a file on
// this machine, or if nothing is there. `place`: of the scene in the file, such as "scenes[1]".
fs::path resolveScene(const fs::path& worldFile, const WorldScene& scene, const std::string& place);

}  // namespace tessera
