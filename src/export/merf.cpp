#include "export/merf.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>

#include "base/check.h"
#include "base/error.h"
#include "base/image_io.h"
#include "export/atomic_folder.h"
#include "export/merf_layout.h"
#include "representations/volume/content/volume_payload.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

constexpr const char* kTrainOneBlock =
    "train with --method volume --blocks 1x1 --set background_block=border, bake that, and export the scene";

bool isOurs(const std::string& name) {
  static const std::regex kNames(
      "(plane_(rgb_and_density|features)_[0-2]|sparse_grid_(rgb_and_density|features)_[0-9]{3,4}|"
      "sparse_grid_block_indices|occupancy_grid_(8|16|32|64|128))\\.png|scene_params\\.json");
  return std::regex_match(name, kNames);
}

// Returns the only content of the finest level; `file` receives its path.
VolumeContent readOnlyContent(const fs::path& scene, const Tileset& tileset, fs::path& file) {
  const auto unsuitable = [&](const std::string& why) {
    return Error((scene / "tileset.json").string(), "", why, kTrainOneBlock);
  };
  if (tileset.representation != kVolumeName) {
    throw unsuitable(fmt::format("is a scene of {}, and MERF's viewer knows volume only", tileset.representation));
  }
  if (tileset.allCells().cells() != 1) {
    throw unsuitable(fmt::format("has {} by {} blocks, but MERF supports only one block, which owns all of space",
                                 tileset.columns, tileset.rows));
  }
  for (const Tile& tile : tileset.tiles) {
    for (const TileContent& content : tile.contents) {
      if (content.backgroundBlock)
        throw unsuitable("has a separate background block, but MERF supports only one block");
    }
  }
  const Tile& finest = tileset.tiles.back();  // with one cell, each tile is the only child of the one before
  if (finest.contents.size() != 1)
    throw unsuitable("does not have exactly one content, but MERF supports only one block");
  file = contentPath(scene, finest.contents[0].uri);
  return contentAs<VolumeContent>(
      *readVerifiedContent(file, volumeCodec(), tileset.tiles.size() - 1, finest.contents[0]));
}

void requireMerfBlock(const VolumeContent& content, const fs::path& file) {
  const auto unsuitable = [&](const std::string& why) { return Error(file.string(), "", why, kTrainOneBlock); };
  if (content.parts.size() != 1) throw unsuitable("merges several blocks, but MERF supports only one");
  const VolumePart& part = content.parts[0];
  if (!part.contracted) throw unsuitable("is a bounded block, but MERF requires a contracted one");
  if (part.scale[0] != part.scale[1] || part.scale[0] != part.scale[2]) {
    throw unsuitable("has different scales along its axes");
  }
  const auto hasShape = [&](size_t layer, uint32_t inputs, uint32_t outputs) {
    return content.network[layer].inputs == inputs && content.network[layer].outputs == outputs;
  };
  if (content.network.size() != 3 || !hasShape(0, 34, 16) || !hasShape(1, 16, 16) || !hasShape(2, 16, 3)) {
    throw unsuitable("has a network that is not 34, 16, 16, 3 wide, as MERF's viewer has it");
  }
  if (part.storedMacroblocks() == 0) {
    throw Error(file.string(), "", "contains nothing visible", "train longer, and bake again");
  }
  // The viewer's three.js (r113) uploads texture rows whose length is a multiple of 4 bytes; other grids stay empty.
  // The widths are ⌈planes / 128⌉ bytes for the coarsest occupancy grid, and 3 bytes for each of voxels / 8
  // macroblocks.
  if (part.planes % 512 != 0 || part.voxels % 32 != 0) {
    throw Error(file.string(), "",
                fmt::format("has {} voxels and planes of {} texels, and MERF's viewer can load multiples of 32 and 512",
                            part.voxels, part.planes),
                "train with --set voxels=128 --set planes=512, bake that, and export the scene");
  }
}

class MerfFolder {
 public:
  explicit MerfFolder(const fs::path& root) : root_(root) {}

  void add(const std::string& name, const ImageU8& image) {
    const Bytes bytes = encodePng(image);
    writeFileAtomically(root_ / (name + ".png"), bytes, true);
    bytes_ += bytes.size();
  }
  void add(const std::string& name, const nlohmann::ordered_json& json) {
    const std::string text = json.dump();
    writeFileAtomically(root_ / name, text, true);
    bytes_ += text.size();
  }
  uint64_t bytes() const { return bytes_; }

 private:
  fs::path root_;
  uint64_t bytes_ = 0;
};

nlohmann::ordered_json sceneParameters(const VolumeContent& content, const std::array<uint32_t, 3>& atlas) {
  const VolumePart& part = content.parts[0];
  // Densities are per scene unit; the viewer's unit is `scale` scene units. So exp(sum - 1) must become `scale` times
  // as large, where the sum has four terms with ranges of their own.
  const double denser = std::log(static_cast<double>(part.scale[0])) / 4;
  nlohmann::ordered_json json = {{"triplane_resolution", part.planes},
                                 {"triplane_voxel_size", 4.0 / part.planes},
                                 {"sparse_grid_resolution", part.voxels},
                                 {"sparse_grid_voxel_size", 4.0 / part.voxels},
                                 {"range_features", {-content.featureRange, content.featureRange}},
                                 {"range_density", {denser - content.densityRange, denser + content.densityRange}},
                                 {"data_block_size", VolumePart::kMacroblock},
                                 {"atlas_width", VolumePart::kStoredEdge * atlas[0]},
                                 {"atlas_height", VolumePart::kStoredEdge * atlas[1]},
                                 {"atlas_depth", VolumePart::kStoredEdge * atlas[2]},
                                 {"num_slices", VolumePart::kStoredEdge * atlas[2]},
                                 {"slice_depth", 1}};
  const std::array<MerfLayer, 3> network = merfNetwork(content.network);
  for (size_t l = 0; l < network.size(); ++l) {
    json[fmt::format("{}_weights", l)] = network[l].weights;
    json[fmt::format("{}_bias", l)] = network[l].biases;
  }
  return json;
}

}  // namespace

MerfExport writeMerf(const VolumeContent& content, const fs::path& folder) {
  CHECK(content.parts.size() == 1u);
  const VolumePart& part = content.parts[0];
  CHECK(part.contracted);
  const std::array<uint32_t, 3> atlas = merfAtlas(part.storedMacroblocks());
  MerfFolder files(folder);
  MerfExport exported;
  exported.macroblocks = part.storedMacroblocks();
  exported.slices = VolumePart::kStoredEdge * atlas[2];
  for (const MerfPicture& picture : kMerfPictures) {
    for (int plane = 0; plane < 3; ++plane) {
      files.add(fmt::format("plane_{}_{}", picture.name, plane), merfPlane(part, plane, picture));
    }
    for (uint32_t slice = 0; slice < exported.slices; ++slice) {
      files.add(fmt::format("sparse_grid_{}_{:03}", picture.name, slice), merfAtlasSlice(part, atlas, slice, picture));
    }
  }
  files.add("sparse_grid_block_indices", merfBlockIndices(part, atlas));
  for (const uint32_t factor : kMerfOccupancyFactors) {
    files.add(fmt::format("occupancy_grid_{}", factor), merfOccupancy(part, factor));
  }
  files.add("scene_params.json", sceneParameters(content, atlas));
  exported.bytesOnDisk = files.bytes();
  return exported;
}

MerfExport exportMerf(const fs::path& scene, const fs::path& out) {
  if (!fs::exists(scene / "tileset.json") && fs::exists(scene / "blocks.json")) {
    throw Error(scene.string(), "", "is a model, but only baked scenes can be exported",
                "run tessera bake, and export the scene");
  }
  const Tileset tileset = readTileset(scene);
  fs::path file;
  const VolumeContent content = readOnlyContent(scene, tileset, file);
  requireMerfBlock(content, file);
  AtomicFolder folder(out, isOurs);
  MerfExport exported = writeMerf(content, folder.path());
  exported.near = tileset.near / content.parts[0].scale[0];
  folder.commit();
  return exported;
}

}  // namespace tessera
