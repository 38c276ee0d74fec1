// Ordinary models (glTF, GLB, OBJ, FBX) as triangles with materials.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/image.h"
#include "scene/axes.h"

namespace tessera {

struct ModelVertex {
  Vec3f position = Vec3f::Zero();  // metres, z up, relative to the model's origin
  Vec3f normal = Vec3f::UnitZ();
  std::array<float, 2> place = {};  // in the texture: 0 to 1 to the right and down, beyond it repeats
  uint32_t colour =
      0xffffffff;  // linear red, green, blue, opacity, from the lowest byte on; multiplies the base colour
  uint32_t material = 0;
};

struct ModelMaterial {
  std::array<float, 3> baseColour = {1, 1, 1};  // linear
  float opacity = 1;
  float cutoff = 0;  // surfaces of less opacity are not drawn; all others are opaque
  float metalness = 0, roughness = 0.8f;
  std::array<float, 3> emission = {};  // linear
  int texture = -1;                    // multiplies base colour and opacity; -1: none
  int surfaceTexture = -1;             // its green multiplies the roughness, its blue the metalness; -1: none
  int emissionTexture = -1;            // multiplies the emission; -1: none
  bool isDoubleSided = false;
  bool isLit = true;  // if false, it looks the same in any light
};

struct Model {
  std::vector<ModelVertex> vertices;
  std::vector<uint32_t> corners;  // of triangles, anticlockwise as seen from the front
  std::vector<ModelMaterial> materials;
  std::vector<ImageU8> textures;     // 4 channels; sRGB, but linear as surfaceTexture
  std::vector<std::string> lacking;  // textures that were not provided, or cannot be decoded
};

// Returns the content of a file that a model names, or nothing. Paths are those of the model's file list.
using ModelFileReader = std::function<std::optional<Bytes>(const std::string& path)>;

struct ModelLimits {
  uint64_t fileBytes = uint64_t{512} << 20;  // of each file
  size_t triangles = 4'000'000;
  int64_t texturePixels = int64_t{1} << 26;  // of all textures of the model
};

// Reads a model without animations, skins and morph targets. `path`: of its own file; its extension states the format.
// Throws Error that names `path` if the file is not provided, cannot be read, exceeds a limit or holds nothing to draw.
Model readModel(const std::string& path, const ModelFileReader& readFile, const ModelLimits& limits = {});

}  // namespace tessera
