#include "world/model.h"

#include <assimp/GltfMaterial.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cctype>
#include <cmath>
#include <cstring>
#include <map>

#include "base/error.h"
#include "base/image_io.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr size_t kMaxNesting = 256;  // of nodes
constexpr size_t kMaxMaterials = 65536;
constexpr float kMatt = 0.8f;  // the roughness of materials whose format states none, as in the browser
constexpr const char* kExportAgain = "export it again, as GLB if you can";

std::string lowerExtension(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

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

float unit(float x) {
  return std::isfinite(x) ? std::clamp(x, 0.0f, 1.0f) : 0;
}

Vec3f asVector(const aiVector3D& v) {
  return {v.x, v.y, v.z};
}

// From y up to z up.
Vec3f raised(const Vec3f& v) {
  return {v.x(), -v.z(), v.y()};
}

class ModelBuilder {
 public:
  ModelBuilder(const std::string& path, const ProvidedFiles& files, const aiScene& scene, const ModelLimits& limits)
      : path_(path), files_(files), scene_(scene), limits_(limits) {}

  Model build() {
    const std::string extension = lowerExtension(path_);
    isGltf_ = extension == ".gltf" || extension == ".glb";
    if (scene_.mNumMaterials > kMaxMaterials) refuse("has too many materials", kExportAgain);
    for (unsigned i = 0; i < scene_.mNumMaterials; ++i) addMaterial(*scene_.mMaterials[i]);
    if (model_.materials.empty()) model_.materials.emplace_back();
    if (scene_.mRootNode != nullptr) add(*scene_.mRootNode, aiMatrix4x4(), 0);
    if (model_.corners.empty()) refuse("holds nothing to draw", "export it again, with its meshes");
    return std::move(model_);
  }

 private:
  [[noreturn]] void refuse(const std::string& reason, const std::string& remedy) const {
    throw Error(path_, "", reason, remedy);
  }

  void addMaterial(const aiMaterial& from) {
    ModelMaterial& material = model_.materials.emplace_back();
    aiColor4D colour(1, 1, 1, 1);
    const bool hasBase = from.Get(AI_MATKEY_BASE_COLOR, colour) == aiReturn_SUCCESS;
    if (!hasBase) from.Get(AI_MATKEY_COLOR_DIFFUSE, colour);
    if (std::string_view(from.GetName().C_Str()) == AI_DEFAULT_MATERIAL_NAME) colour = {1, 1, 1, 1};  // not grey
    float opacity = 1;
    from.Get(AI_MATKEY_OPACITY, opacity);
    const float numbers[] = {unit(colour.r), unit(colour.g), unit(colour.b)};
    for (size_t c = 0; c < 3; ++c) material.baseColour[c] = isGltf_ ? numbers[c] : linearFromSrgb(numbers[c]);
    material.opacity = isGltf_ ? unit(colour.a) : unit(opacity);
    aiString mode;
    if (isGltf_) {
      material.roughness = 1;
      material.metalness = 1;
      float cutoff = 0.5f;
      from.Get(AI_MATKEY_GLTF_ALPHACUTOFF, cutoff);
      from.Get(AI_MATKEY_GLTF_ALPHAMODE, mode);
      const std::string_view word = mode.C_Str();
      material.cutoff = word == "MASK" ? unit(cutoff) : word == "BLEND" ? 0.5f : 0;
      from.Get(AI_MATKEY_METALLIC_FACTOR, material.metalness);
      from.Get(AI_MATKEY_ROUGHNESS_FACTOR, material.roughness);
    } else {
      material.cutoff = material.opacity < 1 ? 0.5f : 0;
      material.roughness = kMatt;
    }
    material.metalness = unit(material.metalness);
    material.roughness = unit(material.roughness);
    aiColor3D emission(0, 0, 0);
    from.Get(AI_MATKEY_COLOR_EMISSIVE, emission);
    material.emission = {unit(emission.r), unit(emission.g), unit(emission.b)};
    int twoSided = 0;
    from.Get(AI_MATKEY_TWOSIDED, twoSided);
    material.isDoubleSided = twoSided != 0;
    int shading = 0;
    from.Get(AI_MATKEY_SHADING_MODEL, shading);
    material.isLit = !isGltf_ || shading != aiShadingMode_Unlit;
    aiString texture;
    if (from.GetTexture(aiTextureType_BASE_COLOR, 0, &texture) == aiReturn_SUCCESS ||
        from.GetTexture(aiTextureType_DIFFUSE, 0, &texture) == aiReturn_SUCCESS) {
      material.texture = addTexture(texture.C_Str());
    }
  }

  // Returns the number of a texture; -1 if it is not provided or cannot be decoded.
  int addTexture(const std::string& name) {
    if (const auto known = textures_.find(name); known != textures_.end()) return known->second;
    int& number = textures_[name] = -1;
    ImageU8 image = readTexture(name);
    if (image.empty()) {
      model_.lacking.push_back(name.starts_with('*') ? "an embedded texture" : name);
      return number;
    }
    texturePixels_ += static_cast<int64_t>(image.pixelCount());
    if (texturePixels_ > limits_.texturePixels) {
      refuse(fmt::format("has textures of more than {} million pixels", limits_.texturePixels / 1'000'000),
             "make its textures smaller");
    }
    number = static_cast<int>(model_.textures.size());
    model_.textures.push_back(std::move(image));
    return number;
  }

  // Returns an image of 4 channels, which is empty if there is none.
  ImageU8 readTexture(const std::string& name) const {
    const aiTexture* embedded = scene_.GetEmbeddedTexture(name.c_str());
    std::optional<Bytes> file;
    std::span<const std::byte> bytes;
    if (embedded != nullptr) {
      if (embedded->mHeight != 0) return {};  // stored as texels, which none of the formats does
      bytes = {reinterpret_cast<const std::byte*>(embedded->pcData), embedded->mWidth};
    } else {
      file = files_.read((fs::path(path_).parent_path() / decodePercent(name)).generic_string());
      if (!file) return {};
      bytes = *file;
    }
    const auto decoded = decodeImage(bytes, {.maxPixels = limits_.texturePixels});
    if (!decoded || decoded->image.empty()) return {};
    const ImageU8& image = decoded->image;
    ImageU8 whole(image.width, image.height, 4, 255);
    for (size_t p = 0; p < image.pixelCount(); ++p) {
      const uint8_t* from = image.pixels.data() + p * static_cast<size_t>(image.channels);
      for (size_t c = 0; c < 3; ++c) whole.pixels[4 * p + c] = image.channels >= 3 ? from[c] : from[0];
      if (image.channels == 4) whole.pixels[4 * p + 3] = from[3];
    }
    return whole;
  }

  void add(const aiNode& node, const aiMatrix4x4& above, size_t nesting) {
    if (nesting > kMaxNesting) refuse("is nested too deep", "export it again, with fewer groups in groups");
    const aiMatrix4x4 toModel = above * node.mTransformation;
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add(*scene_.mMeshes[node.mMeshes[i]], toModel);
    for (unsigned i = 0; i < node.mNumChildren; ++i) add(*node.mChildren[i], toModel, nesting + 1);
  }

  void add(const aiMesh& mesh, const aiMatrix4x4& toModel) {
    if ((mesh.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) == 0) return;
    if (model_.corners.size() / 3 + mesh.mNumFaces > limits_.triangles ||
        model_.vertices.size() + mesh.mNumVertices > 3 * limits_.triangles) {
      refuse(fmt::format("has more than {} triangles", limits_.triangles), "export it with fewer");
    }
    aiMatrix3x3 turn(toModel);
    const bool isMirrored = turn.Determinant() < 0;
    aiMatrix3x3 normals = turn;
    normals.Inverse().Transpose();
    const size_t first = model_.vertices.size();
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      ModelVertex& vertex = model_.vertices.emplace_back();
      vertex.position = raised(asVector(toModel * mesh.mVertices[i]));
      if (!(vertex.position.array().abs() < 1e9f).all()) {
        refuse("has no size that makes sense", "export it again, in metres");
      }
      if (mesh.HasNormals()) {
        const Vec3f normal = raised(asVector(normals * mesh.mNormals[i]));
        if (normal.allFinite() && normal.squaredNorm() > 0) vertex.normal = normal.normalized();
      }
      if (mesh.HasTextureCoords(0)) {
        const aiVector3D& place = mesh.mTextureCoords[0][i];
        if (std::isfinite(place.x) && std::isfinite(place.y)) vertex.place = {place.x, place.y};
      }
      if (mesh.HasVertexColors(0)) {
        const aiColor4D& colour = mesh.mColors[0][i];
        const float numbers[] = {colour.r, colour.g, colour.b, colour.a};
        vertex.colour = 0;
        for (unsigned c = 0; c < 4; ++c) {
          vertex.colour |= static_cast<uint32_t>(std::lround(255 * unit(numbers[c]))) << 8 * c;
        }
      }
      vertex.material = std::min<uint32_t>(mesh.mMaterialIndex, static_cast<uint32_t>(model_.materials.size()) - 1);
    }
    for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
      const aiFace& face = mesh.mFaces[i];
      if (face.mNumIndices != 3) continue;
      const unsigned order[] = {0, isMirrored ? 2u : 1u, isMirrored ? 1u : 2u};
      if (std::any_of(order, order + 3, [&](unsigned k) { return face.mIndices[k] >= mesh.mNumVertices; })) continue;
      std::array<uint32_t, 3> corners;
      for (size_t k = 0; k < 3; ++k) corners[k] = static_cast<uint32_t>(first) + face.mIndices[order[k]];
      if (!mesh.HasNormals()) flatten(corners);
      model_.corners.insert(model_.corners.end(), corners.begin(), corners.end());
    }
  }

  // Gives a triangle corners of its own, with its own normal: meshes without normals are flat.
  void flatten(std::array<uint32_t, 3>& corners) {
    std::vector<ModelVertex>& vertices = model_.vertices;
    const Vec3f a = vertices[corners[0]].position, b = vertices[corners[1]].position, c = vertices[corners[2]].position;
    const Vec3f across = (b - a).cross(c - a);
    for (uint32_t& corner : corners) {
      ModelVertex vertex = vertices[corner];
      if (across.squaredNorm() > 0 && across.allFinite()) vertex.normal = across.normalized();
      corner = static_cast<uint32_t>(vertices.size());
      vertices.push_back(vertex);
    }
  }

  const std::string& path_;
  const ProvidedFiles& files_;
  const aiScene& scene_;
  const ModelLimits& limits_;
  bool isGltf_ = false;
  Model model_;
  std::map<std::string, int> textures_;
  int64_t texturePixels_ = 0;
};

}  // namespace

Model readModel(const std::string& path, const ModelFileReader& readFile, const ModelLimits& limits) {
  const std::string extension = lowerExtension(path);
  const std::string_view known[] = {".gltf", ".glb", ".obj", ".fbx"};
  if (std::find(std::begin(known), std::end(known), extension) == std::end(known)) {
    throw Error(path, "", "is no model", "name a file of glTF, GLB, OBJ or FBX");
  }
  const std::optional<Bytes> own = readFile(path);
  if (!own) throw Error(path, "", "there is no such file", "correct the name, or put the file there");
  if (own->size() > limits.fileBytes) {
    throw Error(path, "", fmt::format("is larger than {} MiB", limits.fileBytes >> 20),
                "export it with fewer triangles, or smaller textures");
  }
  ProvidedFiles* files = new ProvidedFiles(readFile, limits.fileBytes);
  Assimp::Importer importer;
  importer.SetIOHandler(files);  // which the importer deletes
  importer.SetPropertyInteger(AI_CONFIG_PP_SBP_REMOVE, aiPrimitiveType_POINT | aiPrimitiveType_LINE);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_ANIMATIONS, false);
  const aiScene* scene = nullptr;
  try {
    scene = importer.ReadFile(path, aiProcess_ValidateDataStructure | aiProcess_Triangulate | aiProcess_SortByPType |
                                        aiProcess_FindInvalidData | aiProcess_JoinIdenticalVertices |
                                        aiProcess_FlipUVs | aiProcess_GlobalScale);
  } catch (const std::exception& error) {
    throw Error(path, "", fmt::format("cannot be read: {}", error.what()), kExportAgain);
  }
  if (scene == nullptr) {
    throw Error(path, "", fmt::format("cannot be read: {}", std::string(importer.GetErrorString()).substr(0, 200)),
                kExportAgain);
  }
  return ModelBuilder(path, *files, *scene, limits).build();
}

}  // namespace tessera
