// Contents of all levels of detail to a scene on disk: a tree of tiles, and the surround of each level. Whatever the
// representation.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "bake/levels.h"
#include "tiles/scene_folder.h"

namespace tessera {

struct BakedLevel {
  uint64_t bytesOnDisk = 0, bytesInMemory = 0;
  uint64_t macroblocks = 0;
};

struct BakedScene {
  Tileset tileset;
  std::vector<BakedLevel> levels;  // the finest first; the surround counts there
};

// What a tile says of a content.
struct ContentSummary {
  SceneBox box;  // of all that its parts own
  uint64_t bytesInMemory = 0, macroblocks = 0;
  double largestScale = 0;  // of its parts, along any axis
};
template <class Content>  // VolumeContent or HashContent
ContentSummary summaryOf(const Content& content) {
  ContentSummary summary{{Vec3d::Constant(1e30), Vec3d::Constant(-1e30)}, bytesInMemory(content), 0, 0};
  for (const auto& part : content.parts) {
    summary.box.low = summary.box.low.cwiseMin(Vec3d(part.low[0], part.low[1], part.low[2]));
    summary.box.high = summary.box.high.cwiseMax(Vec3d(part.high[0], part.high[1], part.high[2]));
    summary.macroblocks += part.storedMacroblocks();
    for (const float scale : part.scale) summary.largestScale = std::max<double>(summary.largestScale, scale);
  }
  return summary;
}

// Where no photo looked, unless a bake is told otherwise.
inline constexpr std::array<float, 3> kHazySky = {0.74f, 0.8f, 0.86f};

// What is said of a scene, besides its tiles.
struct SceneDescription {
  std::string representation;
  double near = 0.05;  // scene units
  std::array<float, 3> background = kHazySky;
};

class SceneWriter {
 public:
  SceneWriter(const fs::path& folder, const Capture& capture, const BlockGrid& grid, const SceneDescription& about);

  // The finest (0) first. `texels`: that a domain of a level is fine, along an axis.
  void beginLevel(uint32_t texels);
  // A content of the level begun last; its file is written at once. Throws Error where it cannot be.
  void add(const CellGroup& cells, std::span<const std::byte> file, const ContentSummary& content);
  void addSurround(std::span<const std::byte> file, const ContentSummary& content);

  // Writes tileset.json. Each level's groups nest in those of the next.
  BakedScene commit();

 private:
  struct Level {
    std::vector<TileContent> contents;  // [groups]
    std::optional<TileContent> surround;
    uint32_t texels = 1;
    BakedLevel sizes;
  };
  TileContent write(const std::string& name, std::span<const std::byte> file, const ContentSummary& content);
  uint32_t addTiles(size_t level, size_t group);
  void addRoot(const Level& top);

  SceneFolderWriter folder_;
  Tileset tileset_;
  std::vector<Level> levels_;
};

}  // namespace tessera
