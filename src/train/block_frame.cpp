#include "train/block_frame.h"

#include "base/error.h"

namespace tessera {

SceneFrame makeSceneFrame(const BlockGrid& grid) {
  SceneFrame frame;
  frame.centre = grid.inWorld({0, 0, (grid.bottom + grid.top) / 2});
  frame.rotation = grid.gridFromWorld;
  frame.scale = 2 / grid.edge;
  return frame;
}

BlockSpace makeBlockSpace(const BlockGrid& grid, double near, BackgroundBlockMode backgroundBlock) {
  BlockSpace space;
  space.columns = static_cast<uint32_t>(grid.columns);
  space.rows = static_cast<uint32_t>(grid.rows);
  space.top = static_cast<float>((grid.top - grid.bottom) / grid.edge);
  space.bottom = -space.top;
  space.near = static_cast<float>(near);
  space.backgroundBlock = backgroundBlock;
  return space;
}

void requireOneFileABlock(const fs::path& folder, const ModelManifest& manifest, uint32_t blocks) {
  if (manifest.files.size() == blocks) return;
  throw Error((folder / "manifest.json").string(), "files", "does not name one checkpoint a block",
              "restore the file or train again");
}

BackgroundBlockMode parseBackgroundBlockMode(const std::string& name) {
  if (name == "own") return BackgroundBlockMode::own;
  if (name == "border") return BackgroundBlockMode::border;
  if (name == "none") return BackgroundBlockMode::none;
  throw Error("--set background_block=" + name, "", "there is no such background block", "use own, border or none");
}

BlockGrid requireGrid(const ModelFolder& folder) {
  const std::optional<BlockGrid> grid = folder.readPlacement().grid;
  if (grid) return *grid;
  throw Error((folder.root() / "blocks.json").string(), "grid", "there is none", "restore the file or train again");
}

}  // namespace tessera
