// `tessera bake`: a trained volume model to a scene of tiles. Of a model that holds few of its blocks at a time
// (VolumeModel::bring) no more are ever in memory, and one checkpoint while it is read; of all blocks AliveTexels, of
// which alive_texels.h says what they take; and the tile that is being written.
#pragma once

#include <functional>
#include <memory>

#include "bake/baker.h"
#include "representations/volume/bake/alive_texels.h"
#include "representations/volume/content/volume_content.h"
#include "representations/volume/train/volume_model.h"
#include "scene/capture.h"

namespace tessera {

// Gives the model of a level, the finest (0) first. One is held at a time.
using LevelModels = std::function<std::unique_ptr<VolumeModel>(uint32_t level)>;

// Of models of all levels. Opacities below the last threshold of training (`cull_last`) are culled.
std::unique_ptr<Baker> makeVolumeBaker(LevelModels models, uint32_t levels);

// bakeScene of that: writes the scene folder; tileset.json last. A function of models, capture and options. Throws
// Error when a file cannot be written.
BakedScene bakeVolume(const LevelModels& models, uint32_t levels, const Capture& capture, const fs::path& scene,
                      const BakeOptions& options);

// The steps of it. What training photos see through the pixels that no mask leaves out, [blocks]. Where not all blocks
// are in memory, stay by stay: see bake_stays.h, also for what is kept of pixels whose blocks do not fit together, of
// which it warns; what the stay lacks behind the coarse depth of a pixel is air, as it was in training. Throws Error
// when a mask cannot be read.
std::vector<AliveTexels> findAliveTexels(VolumeModel& model, const Capture& capture, const BakeOptions& options);
// The texels of a block that is in memory.
VolumePart bakePart(VolumeModel& model, uint32_t block, const AliveTexels& alive);
// What is composited and shaded together: the blocks of one of the model's groups, brought in one after another.
// `alive` by block.
VolumeContent bakeGroup(VolumeModel& model, uint32_t group, const std::vector<AliveTexels>& alive);

}  // namespace tessera
