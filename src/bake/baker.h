// How an opened model becomes a scene of tiles: a baker says what stands where, one driver writes it down. Whatever the
// representation, and however its levels of detail are held: one model a level (level_baker.h), or all in one.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "bake/bake_options.h"
#include "base/file.h"
#include "scene/capture.h"
#include "tiles/tileset.h"

namespace tessera {

// What a content states of itself.
struct ContentSummary {
  SceneBox box;               // of all that it owns, scene units
  bool isBackground = false;  // it stands for what lies outside the scene's box, behind everything else
  double geometricError = 0;  // scene units: of drawing it instead of what it was baked from
  uint64_t memoryBytes = 0;   // of the content in memory, without the resources that it shares
  std::vector<std::pair<std::string, uint64_t>> counts;  // what else there is to say of it: how many of what
};

// Where contents and what they share go. Files are written at once; all calls throw Error where they cannot be.
class ContentSink {
 public:
  virtual ~ContentSink() = default;

  // A file that several contents need, as a network. The same bytes under the same name are one. Returns its number,
  // for add(). `name`: letters, digits, '_'.
  virtual uint32_t addResource(const std::string& name, const std::string& mimeType,
                               std::span<const std::byte> bytes) = 0;
  // A content of a level of detail, 0 being the finest; in any order of levels. `cells`: of the block grid, what it
  // stands for; nothing for the background, of which a level has one at most. `glb`: its file.
  virtual void add(uint32_t level, const std::optional<CellRange>& cells, std::span<const std::byte> glb,
                   const ContentSummary& content, const std::vector<uint32_t>& resources = {}) = 0;
};

// Where no photo looked, unless a bake is told otherwise.
inline constexpr std::array<float, 3> kHazySky = {0.74f, 0.8f, 0.86f};

// What is said of a scene, besides its tiles.
struct SceneDescription {
  std::string representation;  // its name
  BlockGrid grid;
  double near = 0.05;                          // scene units
  std::array<float, 3> background = kHazySky;  // where no photo looked, unless BakeOptions say otherwise
};

// An opened model of some method.
class Baker {
 public:
  virtual ~Baker() = default;

  // Asked before bake().
  virtual SceneDescription description() const = 0;
  // Once. Adds the contents of all levels: each level's cells nest in those of the next, and hold all of the grid.
  // A function of the model, the capture and the options. Throws Error when a scene cannot hold the model, or a photo's
  // mask cannot be read.
  virtual void bake(const Capture& capture, const BakeOptions& options, ContentSink& sink) = 0;
};

struct BakedLevel {
  uint64_t bytesOnDisk = 0, bytesInMemory = 0;
  std::vector<std::pair<std::string, uint64_t>> counts;  // of all its contents together
};

struct BakedScene {
  Tileset tileset;
  std::vector<BakedLevel> levels;  // the finest first; the background counts there
};

// The one driver. Writes the scene folder; tileset.json last.
BakedScene bakeScene(Baker& baker, const Capture& capture, const fs::path& scene, const BakeOptions& options);

}  // namespace tessera
