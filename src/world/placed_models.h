// The models of a world, read from its files.
#pragma once

#include <vector>

#include "world/model.h"
#include "world/world_file.h"

namespace tessera {

// A model that stands in a world: x_world = position + rotation · scale · x.
struct PlacedModel {
  size_t model = 0;  // number in PlacedModels::models
  Vec3d position = Vec3d::Zero();
  Mat3d rotation = Mat3d::Identity();
  Vec3d scale = Vec3d::Ones();
};

struct PlacedModels {
  std::vector<Model> models;  // each file is read once, however often it is placed
  std::vector<PlacedModel> placed;
};

// Reads the visible models of a world from its embedded files and from paths relative to the folder of `worldFile`, as
// world/model_files.h says. Warns about textures that are missing. Throws Error as readModel does, if a file that the
// world lists has an absolute path or is too large, and if the triangles or the texels of all models together exceed
// the limits of one model fourfold. No model is read once these are exceeded, so that memory is bounded.
PlacedModels readPlacedModels(const World& world, const fs::path& worldFile, const ModelLimits& limits = {});

}  // namespace tessera
