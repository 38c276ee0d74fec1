// Bakes the models of all levels into the contents of a scene.
#include "bake/level_baker.h"
#include "base/log.h"
#include "raymarch/bake/part_summary.h"
#include "representations/volume/bake/bake_volume.h"
#include "representations/volume/content/volume_payload.h"

namespace tessera {
namespace {

constexpr std::array<float, 3> kBlack = {0, 0, 0};

class VolumeBaker final : public LevelBaker<VolumeModel> {
 public:
  using LevelBaker::LevelBaker;

 protected:
  // The background is black if training composited the photos over black.
  SceneDescription describe(const VolumeModel& finest) const override {
    return {"volume", finest.grid(), finest.space().near, finest.config().randomBackground ? kHazySky : kBlack};
  }

  void bakeLevel(VolumeModel& model, uint32_t level, const Capture& capture, const BakeOptions& options,
                 ContentSink& sink) override {
    if (level == 0 && model.config().literalEq3) {
      warn(
          "the model was trained with literal_eq3, but renderers of scenes multiply the network's colour by the "
          "block's opacity: the scene will look different from the model");
    }
    BakeOptions looking = options;
    looking.minAlpha = model.config().cullLast;  // training has culled less opaque samples
    const std::vector<OccupiedTexels> occupied = findOccupiedTexels(model, capture, looking);
    const std::vector<CellRange>& cells = model.groups().cells;
    for (uint32_t group = 0; group < model.groups().groups(); ++group) {
      const VolumeContent content = bakeGroup(model, group, occupied);
      const std::optional<CellRange> ofGroup = group < cells.size() ? std::optional(cells[group]) : std::nullopt;
      sink.add(level, ofGroup, encodeVolume(content, options.effort), partSummary(content, content.parts.at(0).planes));
    }
  }
};

}  // namespace

std::unique_ptr<Baker> makeVolumeBaker(LevelModels models, uint32_t levels) {
  return std::make_unique<VolumeBaker>(std::move(models), levels);
}

BakedScene bakeVolume(const LevelModels& models, uint32_t levels, const Capture& capture, const fs::path& folder,
                      const BakeOptions& options) {
  return bakeScene(*makeVolumeBaker(models, levels), capture, folder, options);
}

}  // namespace tessera
