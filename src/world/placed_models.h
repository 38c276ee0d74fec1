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

// Reads the visible models of a world from its embedded files and from paths relative to the folder of `worldFile`.
// What a model names besides the files that the world lists for it must lie in that folder. Warns about textures that
// are missing. Throws Error as readModel does, and if the triangles of all models together exceed
// its limit fourfold; the texels of all models together have no limit.
PlacedModels readPlacedModels(const World& world, const fs::path& worldFile);

}  // namespace tessera
