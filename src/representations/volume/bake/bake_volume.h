// `tessera bake`: bakes a trained volume model into a scene of tiles. If the model holds only some of its blocks at a
// time (VolumeModel::ensureResident), never more than those are in memory, and one checkpoint while it is read. In
// addition, baking holds the OccupiedTexels of all blocks (occupied_texels.h states their size) and the tile that is
// being written.
#pragma once

#include <functional>
#include <memory>

#include "bake/baker.h"
#include "representations/volume/bake/occupied_texels.h"
#include "representations/volume/content/volume_content.h"
#include "representations/volume/train/volume_model.h"
#include "scene/capture.h"

namespace tessera {

// Opens the model of a level. Called for the finest level (0) first; one model is in memory at a time.
using LevelModels = std::function<std::unique_ptr<VolumeModel>(uint32_t level)>;

// Returns a baker of the models of all levels. Samples whose opacity is below the last threshold of training
// (`cull_last`) are culled.
std::unique_ptr<Baker> makeVolumeBaker(LevelModels models, uint32_t levels);

// Calls bakeScene with that baker: writes the scene folder, tileset.json last. The result is a function of models,
// capture and options. Throws Error if a file cannot be written.
BakedScene bakeVolume(const LevelModels& models, uint32_t levels, const Capture& capture, const fs::path& scene,
                      const BakeOptions& options);

// The steps of baking follow. Returns the texels that the training photos see through pixels that no mask excludes,
// [blocks]. If not all blocks fit in memory, the photos are visited once per resident set; see
// bake_residency_schedule.h, also for what is marked by pixels whose blocks do not fit together, of which this warns.
// Behind the coarse depth of a pixel, blocks that are not resident count as empty, as in training. Throws Error if a
// mask cannot be read.
std::vector<OccupiedTexels> findOccupiedTexels(VolumeModel& model, const Capture& capture, const BakeOptions& options);
// Bakes the texels of a block that is in memory.
VolumePart bakePart(VolumeModel& model, uint32_t block, const OccupiedTexels& occupied);
// Bakes the blocks of one of the model's groups, which are composited and shaded together, into one content, making one
// block after another resident. `occupied`: [blocks].
VolumeContent bakeGroup(VolumeModel& model, uint32_t group, const std::vector<OccupiedTexels>& occupied);

}  // namespace tessera
