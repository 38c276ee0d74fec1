// Models of all levels to a tree of tiles on disk.
#include <optional>

#include "bake/scene_writer.h"
#include "base/log.h"
#include "representations/volume/bake_volume.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

constexpr std::array<float, 3> kBlack = {0, 0, 0};

// Writes the contents of a level.
void bakeLevel(VolumeModel& model, const Capture& capture, const BakeOptions& options, SceneWriter& scene) {
  const std::vector<AliveTexels> alive = findAliveTexels(model, capture, options);
  const std::vector<CellGroup>& cells = model.groups().cells;
  scene.beginLevel(model.virtualGrid().planes);
  for (uint32_t group = 0; group < model.groups().groups(); ++group) {
    const VolumeContent content = bakeGroup(model, group, alive);
    const Bytes file = encodeVolume(content, options.effort);
    if (group < cells.size()) {
      scene.add(cells[group], file, summaryOf(content));
    } else {
      scene.addSurround(file, summaryOf(content));
    }
  }
}

}  // namespace

BakedScene bakeVolume(const LevelModels& models, uint32_t levels, const Capture& capture, const fs::path& folder,
                      const BakeOptions& options) {
  std::optional<SceneWriter> scene;
  const int64_t photos = static_cast<int64_t>(capture.photosIn(Split::train).size());
  for (uint32_t level = 0; level < levels; ++level) {
    BakeOptions ofLevel = options;
    ofLevel.onPhoto = [&](int64_t done, int64_t) { options.onPhoto(level * photos + done, levels * photos); };
    ofLevel.stride <<= level;  // as many rays through its larger texels
    const std::unique_ptr<VolumeModel> model = models(level);
    if (level == 0) {
      const std::array<float, 3> behind = model->config().randomBackground ? kHazySky : kBlack;
      scene.emplace(folder, capture, model->grid(),
                    SceneDescription{kVolumeName, model->space().near, options.background.value_or(behind)});
      if (model->config().literalEq3) {
        warn(
            "the model was trained with literal_eq3; scenes multiply the network's colour by the block's opacity, and "
            "look different");
      }
    }
    bakeLevel(*model, capture, ofLevel, *scene);
  }
  return scene->commit();
}

}  // namespace tessera
