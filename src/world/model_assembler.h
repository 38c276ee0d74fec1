// Puts a Model together from what a reader of one format finds in a file, within the limits.
#pragma once

#include <map>
#include <span>

#include "world/model.h"

namespace tessera {

inline constexpr size_t kMaxModelNesting = 256;  // of nodes
inline constexpr const char* kExportModelAgain = "export it again, as GLB if you can";

// Triangles of one material, as a file has them: y is up. Normals, places and colours are empty or of each position;
// without normals, the triangles are flat.
struct ModelPart {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;
  std::vector<std::array<float, 2>> places;  // as in ModelVertex
  std::vector<uint32_t> colours;             // as in ModelVertex
  std::vector<uint32_t> corners;             // anticlockwise as seen from the front; below the number of positions
  uint32_t material = 0;
};

// All functions throw Error that names the model's file if it exceeds the limits.
class ModelAssembler {
 public:
  // `path`: of the model's own file. The arguments must outlive the object.
  ModelAssembler(const std::string& path, const ModelFileReader& readFile, const ModelLimits& limits)
      : path_(path), readFile_(readFile), limits_(limits) {}

  [[noreturn]] void refuse(const std::string& place, const std::string& reason, const std::string& remedy) const;
  // Returns a file that the model names relative to its own, by its name as it is or with percent signs decoded;
  // nothing if it is not provided.
  std::optional<Bytes> read(const std::string& name) const;

  ModelMaterial& addMaterial();
  // Returns the number of a texture that the model names; -1 if it is not provided or cannot be decoded.
  int addTexture(const std::string& name);
  // The same for a texture within a file; `key` tells it from others.
  int addTexture(const std::string& key, std::span<const std::byte> image);
  // Throws if no room is left for these numbers of triangles and vertices: to be called before they are read.
  void requireRoom(uint64_t triangles, uint64_t vertices) const;
  // `toModel` must be affine.
  void add(const ModelPart& part, const Mat4d& toModel);
  Model finish();

 private:
  int addTexture(const std::string& key, const std::string& label, std::span<const std::byte> image);
  void flatten(std::array<uint32_t, 3>& corners);

  const std::string& path_;
  const ModelFileReader& readFile_;
  const ModelLimits& limits_;
  Model model_;
  std::map<std::string, int> textures_;
  int64_t texturePixels_ = 0;
};

// Returns `x`, or the nearer end of 0 to 1; 0 if it is not a number.
float unitShare(float x);
// Returns a colour of ModelVertex.
uint32_t packColour(const std::array<float, 4>& linear);

}  // namespace tessera
