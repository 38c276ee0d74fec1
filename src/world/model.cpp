#include "world/model.h"

#include <fmt/format.h>

#include <cctype>

#include "base/error.h"
#include "world/assimp_model.h"
#include "world/gltf_model.h"

namespace tessera {
namespace {

std::string lowerExtension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

}  // namespace

Model readModel(const std::string& path, const ModelFileReader& readFile, const ModelLimits& limits) {
  const std::string extension = lowerExtension(path);
  const bool isGltf = extension == ".gltf" || extension == ".glb";
  if (!isGltf && extension != ".obj" && extension != ".fbx") {
    throw Error(path, "", "is no model", "name a file of glTF, GLB, OBJ or FBX");
  }
  const std::optional<Bytes> own = readFile(path);
  if (!own) throw Error(path, "", "there is no such file", "correct the name, or put the file there");
  if (own->size() > limits.fileBytes) {
    throw Error(path, "", fmt::format("is larger than {} MiB", limits.fileBytes >> 20),
                "export it with fewer triangles, or smaller textures");
  }
  ModelAssembler assembler(path, readFile, limits);
  if (isGltf) {
    readGltf(*own, assembler, limits);
  } else {
    readByAssimp(path, readFile, assembler, limits);
  }
  return assembler.finish();
}

}  // namespace tessera
