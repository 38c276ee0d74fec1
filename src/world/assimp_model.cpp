#include "world/assimp_model.h"

#include <assimp/BaseImporter.h>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstring>
#include <memory>

#include "base/error.h"
#include "base/trial.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr float kMatt = 0.8f;  // the roughness of all materials: neither format states one, as in the browser

class ReadStream final : public Assimp::IOStream {
 public:
  explicit ReadStream(Bytes bytes) : bytes_(std::move(bytes)) {}

  size_t Read(void* to, size_t size, size_t count) override {
    if (size == 0) return 0;
    const size_t whole = std::min(count, (bytes_.size() - position_) / size);
    if (whole > 0) std::memcpy(to, bytes_.data() + position_, whole * size);
    position_ += whole * size;
    return whole;
  }
  size_t Write(const void*, size_t, size_t) override { return 0; }
  aiReturn Seek(size_t offset, aiOrigin origin) override {
    const size_t from = origin == aiOrigin_SET ? 0 : origin == aiOrigin_CUR ? position_ : bytes_.size();
    if (origin == aiOrigin_END ? offset > from : offset > bytes_.size() - from) return aiReturn_FAILURE;
    position_ = origin == aiOrigin_END ? from - offset : from + offset;
    return aiReturn_SUCCESS;
  }
  size_t Tell() const override { return position_; }
  size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  Bytes bytes_;
  size_t position_ = 0;
};

// Lets assimp read the provided files and nothing else.
class ProvidedFiles final : public Assimp::IOSystem {
 public:
  ProvidedFiles(const ModelFileReader& readFile, uint64_t maxBytes) : readFile_(readFile), maxBytes_(maxBytes) {}

  std::optional<Bytes> read(std::string path) const {
    std::replace(path.begin(), path.end(), '\\', '/');
    if (path.empty() || isOfNetwork(path)) return std::nullopt;
    std::optional<Bytes> bytes = readFile_(fs::path(path).lexically_normal().generic_string());
    if (bytes && bytes->size() > maxBytes_) return std::nullopt;
    return bytes;
  }
  bool Exists(const char* path) const override { return read(path).has_value(); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* path, const char* mode) override {
    if (std::strchr(mode, 'w') != nullptr) return nullptr;
    std::optional<Bytes> bytes = read(path);
    return bytes ? new ReadStream(std::move(*bytes)) : nullptr;
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  const ModelFileReader& readFile_;
  uint64_t maxBytes_;
};

float linearFromSrgb(float x) {
  return x <= 0.04045f ? x / 12.92f : std::pow((x + 0.055f) / 1.055f, 2.4f);
}

Vec3f asVector(const aiVector3D& v) {
  return {v.x, v.y, v.z};
}

class SceneReader {
 public:
  SceneReader(const aiScene& scene, ModelAssembler& to) : scene_(scene), to_(to) {}

  void read() {
    for (unsigned i = 0; i < scene_.mNumMaterials; ++i) addMaterial(*scene_.mMaterials[i]);
    if (scene_.mRootNode != nullptr) add(*scene_.mRootNode, aiMatrix4x4(), 0);
  }

 private:
  void addMaterial(const aiMaterial& from) {
    ModelMaterial& material = to_.addMaterial();
    aiColor3D colour(1, 1, 1), emission(0, 0, 0);
    from.Get(AI_MATKEY_COLOR_DIFFUSE, colour);
    if (std::string_view(from.GetName().C_Str()) == AI_DEFAULT_MATERIAL_NAME) colour = {1, 1, 1};  // not grey
    from.Get(AI_MATKEY_COLOR_EMISSIVE, emission);
    from.Get(AI_MATKEY_OPACITY, material.opacity);
    material.opacity = unitShare(material.opacity);
    for (unsigned c = 0; c < 3; ++c) {
      material.baseColour[c] = linearFromSrgb(unitShare(colour[c]));
      material.emission[c] = linearFromSrgb(unitShare(emission[c]));
    }
    material.cutoff = material.opacity < 1 ? 0.5f : 0;
    material.roughness = kMatt;
    int twoSided = 0;
    from.Get(AI_MATKEY_TWOSIDED, twoSided);
    material.isDoubleSided = twoSided != 0;
    material.texture = addTexture(from, {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE});
    const auto emissive = {aiTextureType_EMISSIVE, aiTextureType_EMISSION_COLOR};
    material.emissionTexture = addTexture(from, emissive);
    const bool hasLostIt =
        material.emissionTexture < 0 && std::any_of(emissive.begin(), emissive.end(),
                                                    [&](aiTextureType type) { return from.GetTextureCount(type) > 0; });
    if (hasLostIt) material.emission = {0, 0, 0};  // the factor alone would make it a lamp
  }

  int addTexture(const aiMaterial& from, std::initializer_list<aiTextureType> types) {
    aiString name;
    for (const aiTextureType type : types) {
      if (from.GetTexture(type, 0, &name) != aiReturn_SUCCESS) continue;
      const aiTexture* embedded = scene_.GetEmbeddedTexture(name.C_Str());
      if (embedded == nullptr) return to_.addTexture(name.C_Str());
      // A height means that it is stored as texels, which neither format does.
      const auto* bytes = reinterpret_cast<const std::byte*>(embedded->pcData);
      return to_.addTexture(name.C_Str(), {bytes, embedded->mHeight == 0 ? embedded->mWidth : 0});
    }
    return -1;
  }

  void add(const aiNode& node, const aiMatrix4x4& above, size_t nesting) {
    if (nesting > kMaxModelNesting)
      to_.refuse("", "is nested too deep", "export it again, with fewer groups in groups");
    const aiMatrix4x4 toModel = above * node.mTransformation;
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add(*scene_.mMeshes[node.mMeshes[i]], toModel);
    for (unsigned i = 0; i < node.mNumChildren; ++i) add(*node.mChildren[i], toModel, nesting + 1);
  }

  void add(const aiMesh& mesh, const aiMatrix4x4& toModel) {
    if ((mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) == 0) return;
    to_.requireRoom(mesh.mNumFaces, mesh.mNumVertices);
    ModelPart part;
    part.material = mesh.mMaterialIndex;
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      part.positions.push_back(asVector(mesh.mVertices[i]));
      if (mesh.HasNormals()) part.normals.push_back(asVector(mesh.mNormals[i]));
      if (mesh.HasTextureCoords(0)) part.places.push_back({mesh.mTextureCoords[0][i].x, mesh.mTextureCoords[0][i].y});
      if (mesh.HasVertexColors(0)) {
        const aiColor4D& c = mesh.mColors[0][i];
        part.colours.push_back(packColour({c.r, c.g, c.b, c.a}));
      }
    }
    for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
      const aiFace& face = mesh.mFaces[i];
      if (face.mNumIndices != 3) continue;
      const std::span<const unsigned> corners(face.mIndices, 3);
      if (std::any_of(corners.begin(), corners.end(), [&](unsigned k) { return k >= mesh.mNumVertices; })) continue;
      part.corners.insert(part.corners.end(), corners.begin(), corners.end());
    }
    Mat4d matrix;
    for (unsigned row = 0; row < 4; ++row)
      for (unsigned column = 0; column < 4; ++column) matrix(row, column) = toModel[row][column];
    to_.add(part, matrix);
  }

  const aiScene& scene_;
  ModelAssembler& to_;
};

// Leaves the importers of OBJ and FBX alone: assimp tries others by a file's content.
void keepImporters(Assimp::Importer& importer) {
  for (size_t i = importer.GetImporterCount(); i-- > 0;) {
    Assimp::BaseImporter* one = importer.GetImporter(i);
    const aiImporterDesc* info = importer.GetImporterInfo(i);
    const std::string_view extensions = info == nullptr ? "" : info->mFileExtensions;
    if (extensions == "obj" || extensions == "fbx") continue;
    importer.UnregisterLoader(one);
    delete one;
  }
}

// Reads the scene; returns why it cannot be read, or an empty text.
std::string readAssimpScene(Assimp::Importer& importer, const std::string& path) {
  try {
    const aiScene* scene =
        importer.ReadFile(path, aiProcess_ValidateDataStructure | aiProcess_Triangulate | aiProcess_SortByPType |
                                    aiProcess_FindInvalidData | aiProcess_JoinIdenticalVertices | aiProcess_FlipUVs |
                                    aiProcess_GlobalScale);
    if (scene != nullptr) return "";
  } catch (const std::exception& error) {
    return std::string("it fails: ") + error.what();
  }
  const std::string reason = importer.GetErrorString();
  return reason.empty() ? "its reader does not say why" : reason;
}

}  // namespace

void readByAssimp(const std::string& path, const ModelFileReader& readFile, ModelAssembler& to,
                  const ModelLimits& limits) {
  Assimp::Importer importer;
  keepImporters(importer);
  importer.SetIOHandler(new ProvidedFiles(readFile, limits.fileBytes));  // which the importer deletes
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS, false);
  std::string failure = tryInCopy([&] { return readAssimpScene(importer, path); });
  if (failure.empty()) failure = readAssimpScene(importer, path);
  if (!failure.empty()) to.refuse("", fmt::format("cannot be read: {}", failure.substr(0, 200)), kExportModelAgain);
  SceneReader(*importer.GetScene(), to).read();
}

}  // namespace tessera
