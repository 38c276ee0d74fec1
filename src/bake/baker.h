// Turns an opened model into a scene of tiles: a Baker produces the contents, one driver writes them. This is
// independent of the representation and of how levels of detail are stored: one model for each level (level_baker.h),
// or all in one.
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

// What a baker states about a content.
struct ContentSummary {
  SceneBox box;               // of everything that the content owns, scene units
  bool isBackground = false;  // it covers what lies outside the scene's box, behind everything else
  double geometricError = 0;  // scene units: error of drawing it instead of what it was baked from
  uint64_t memoryBytes = 0;   // of the decoded content, without shared resources
  std::vector<std::pair<std::string, uint64_t>> counts;  // further counts to report, by name
};

// Receives contents and shared resources. Files are written at once; all calls throw Error if writing fails.
class ContentSink {
 public:
  virtual ~ContentSink() = default;

  // Adds a file that several contents need, such as a network, and returns its index for add(). The same bytes under
  // the same name are stored once. `name`: letters, digits, '_'.
  virtual uint32_t addResource(const std::string& name, const std::string& mimeType,
                               std::span<const std::byte> bytes) = 0;
  // Returns the uri of a resource that was added, relative to the folder of tileset.json.
  virtual std::string resourceUri(uint32_t resource) const = 0;
  // Adds a content of a level of detail, 0 being the finest; levels may come in any order. `cells`: the cells of the
  // block grid that it covers; nothing for the background, of which a level has at most one. `glb`: its file.
  virtual void add(uint32_t level, const std::optional<CellRange>& cells, std::span<const std::byte> glb,
                   const ContentSummary& content, const std::vector<uint32_t>& resources = {}) = 0;
};

// The default background, for directions that no photo shows.
inline constexpr std::array<float, 3> kHazySky = {0.74f, 0.8f, 0.86f};

// Properties of a scene besides its tiles.
struct SceneDescription {
  std::string representation;  // name of the representation
  BlockGrid grid;
  double near = 0.05;                          // scene units
  std::array<float, 3> background = kHazySky;  // for directions that no photo shows, unless BakeOptions override it
  std::vector<SurfaceCoverage> coverage = {};  // of the surfaces of the finest level, if it was checked
  std::optional<ExposureResponse> exposureResponse = {};  // that of BakeOptions
  std::string name = {};  // for people, that of BakeOptions; empty: that of the capture's folder
};

// The baker of an opened model of some method.
class Baker {
 public:
  virtual ~Baker() = default;

  // Must be called before bake().
  virtual SceneDescription description() const = 0;
  // Must be called once. Adds the contents of all levels: the cells of each level nest in those of the next coarser one
  // and cover the whole grid. The result is a function of the model, the capture and the options. Throws Error if a
  // scene cannot hold the model or a photo's mask cannot be read.
  virtual void bake(const Capture& capture, const BakeOptions& options, ContentSink& sink) = 0;
};

struct BakedLevel {
  uint64_t bytesOnDisk = 0, bytesInMemory = 0;
  std::vector<std::pair<std::string, uint64_t>> counts;  // summed over all its contents
};

struct BakedScene {
  Tileset tileset;
  std::vector<BakedLevel> levels;  // the finest first; includes the backgrounds
};

// Bakes a model with its baker and writes the scene folder; tileset.json is written last. Throws Error as Baker::bake
// does, and if a file cannot be written.
BakedScene bakeScene(Baker& baker, const Capture& capture, const fs::path& scene, const BakeOptions& options);

}  // namespace tessera
