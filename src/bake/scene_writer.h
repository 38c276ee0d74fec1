// Writes contents of all levels of detail to a scene on disk: a tree of tiles, and the background of each level. This
// is independent of the representation.
#pragma once

#include <optional>
#include <vector>

#include "bake/baker.h"
#include "tiles/scene_folder.h"

namespace tessera {

class SceneWriter final : public ContentSink {
 public:
  // Creates the folder. Throws Error if it cannot be written, or if no scene can have the capture's frames or the
  // description's grid and `near`: before hours are spent on its contents.
  SceneWriter(const fs::path& folder, const Capture& capture, const SceneDescription& about);

  uint32_t addResource(const std::string& name, const std::string& mimeType, std::span<const std::byte> bytes) override;
  std::string resourceUri(uint32_t resource) const override { return tileset_.resources.at(resource).uri; }
  void add(uint32_t level, const std::optional<CellRange>& cells, std::span<const std::byte> glb,
           const ContentSummary& content, const std::vector<uint32_t>& resources = {}) override;

  // Writes tileset.json. CHECKs that every level has contents. The cells of each level must nest in those of the next
  // coarser one.
  BakedScene commit();

 private:
  struct Level {
    std::vector<TileContent> contents;    // [groups]
    std::vector<double> geometricErrors;  // [groups], metres
    std::optional<TileContent> background;
    BakedLevel sizes;
  };
  uint32_t addTiles(size_t level, size_t group);
  void addRoot();

  SceneFolderWriter folder_;
  Tileset tileset_;
  std::vector<Level> levels_;
};

}  // namespace tessera
