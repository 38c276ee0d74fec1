#include "world/model_assembler.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/image_io.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr size_t kMaxMaterials = 65536, kMaxTextures = 4096;
constexpr float kFarthestOfModel = 1e9f;  // metres

// From y up to z up.
Vec3f raised(const Vec3d& v) {
  return {static_cast<float>(v.x()), static_cast<float>(-v.z()), static_cast<float>(v.y())};
}

// Returns an image of 4 channels, which is empty if it cannot be decoded.
ImageU8 decodeTexture(std::span<const std::byte> bytes, int64_t maxPixels) {
  const auto decoded = decodeImage(bytes, {.maxPixels = maxPixels});
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

}  // namespace

float unitShare(float x) {
  return std::isnan(x) ? 0 : std::clamp(x, 0.0f, 1.0f);
}

uint32_t packColour(const std::array<float, 4>& linear) {
  uint32_t packed = 0;
  for (unsigned c = 0; c < 4; ++c) packed |= static_cast<uint32_t>(std::lround(255 * unitShare(linear[c]))) << 8 * c;
  return packed;
}

void ModelAssembler::refuse(const std::string& place, const std::string& reason, const std::string& remedy) const {
  throw Error(path_, place, reason, remedy);
}

std::optional<Bytes> ModelAssembler::read(const std::string& name) const {
  for (std::string plain : {name, decodePercent(name)}) {
    std::replace(plain.begin(), plain.end(), '\\', '/');
    if (plain.empty() || isOfNetwork(plain)) return std::nullopt;
    const fs::path path = fs::path(path_).parent_path() / plain;
    if (std::optional<Bytes> bytes = readFile_(path.lexically_normal().generic_string())) {
      if (bytes->size() > limits_.fileBytes) return std::nullopt;
      return bytes;
    }
  }
  return std::nullopt;
}

ModelMaterial& ModelAssembler::addMaterial() {
  if (model_.materials.size() >= kMaxMaterials) refuse("", "has too many materials", "export it with fewer");
  return model_.materials.emplace_back();
}

int ModelAssembler::addTexture(const std::string& name) {
  if (const auto known = textures_.find(name); known != textures_.end()) return known->second;
  const std::optional<Bytes> bytes = read(name);
  return addTexture(name, name, bytes ? std::span<const std::byte>(*bytes) : std::span<const std::byte>());
}

int ModelAssembler::addTexture(const std::string& key, std::span<const std::byte> image) {
  if (const auto known = textures_.find(key); known != textures_.end()) return known->second;
  return addTexture(key, "an embedded texture", image);
}

int ModelAssembler::addTexture(const std::string& key, const std::string& label, std::span<const std::byte> image) {
  if (textures_.size() >= kMaxTextures) refuse("", "has too many textures", "export it with fewer");
  int& number = textures_[key] = -1;
  const auto info = probeImage(image);
  if (info && texturePixels_ + int64_t{info->width} * info->height > limits_.texturePixels) {
    refuse("", fmt::format("has textures of more than {} million pixels", limits_.texturePixels / 1'000'000),
           "make its textures smaller");
  }
  ImageU8 decoded = decodeTexture(image, limits_.texturePixels - texturePixels_);
  if (decoded.empty()) {
    model_.lacking.push_back(label);
    return number;
  }
  texturePixels_ += static_cast<int64_t>(decoded.pixelCount());
  number = static_cast<int>(model_.textures.size());
  model_.textures.push_back(std::move(decoded));
  return number;
}

void ModelAssembler::requireRoom(uint64_t triangles, uint64_t vertices) const {
  const uint64_t most = limits_.triangles;
  if (triangles > most || model_.corners.size() / 3 > most - triangles || vertices > 3 * most ||
      model_.vertices.size() > 3 * most - vertices) {
    refuse("", fmt::format("has more than {} triangles", limits_.triangles), "export it with fewer");
  }
}

void ModelAssembler::add(const ModelPart& part, const Mat4d& toModel) {
  const size_t count = part.positions.size();
  CHECK((part.normals.empty() || part.normals.size() == count));
  CHECK((part.places.empty() || part.places.size() == count));
  CHECK((part.colours.empty() || part.colours.size() == count));
  requireRoom(part.corners.size() / 3, part.normals.empty() ? part.corners.size() : count);
  if (model_.materials.empty()) model_.materials.emplace_back();
  const Mat3d turn = toModel.topLeftCorner<3, 3>();
  const Vec3d shift = toModel.topRightCorner<3, 1>();
  const double determinant = turn.determinant();
  Mat3d normals = Mat3d::Identity();
  if (determinant != 0 && turn.allFinite()) normals = turn.inverse().transpose();
  const size_t first = model_.vertices.size();
  const auto vertexFrom = [&](uint32_t i) {
    ModelVertex vertex;
    vertex.position = raised(turn * part.positions[i].cast<double>() + shift);
    if (!(vertex.position.array().abs() < kFarthestOfModel).all()) {
      refuse("", "has no size that makes sense", "export it again, in metres");
    }
    if (!part.normals.empty()) {
      const Vec3f normal = raised((normals * part.normals[i].cast<double>()).stableNormalized());
      if (normal.allFinite() && normal.squaredNorm() > 0) vertex.normal = normal;
    }
    if (!part.places.empty()) vertex.place = part.places[i];
    for (float& x : vertex.place) x = std::isfinite(x) ? x : 0;
    if (!part.colours.empty()) vertex.colour = part.colours[i];
    vertex.material = std::min<uint32_t>(part.material, static_cast<uint32_t>(model_.materials.size()) - 1);
    return vertex;
  };
  if (!part.normals.empty()) {
    for (uint32_t i = 0; i < count; ++i) model_.vertices.push_back(vertexFrom(i));
  }
  for (size_t at = 0; at + 3 <= part.corners.size(); at += 3) {
    std::array<uint32_t, 3> corners = {part.corners[at], part.corners[at + 1], part.corners[at + 2]};
    for (const uint32_t corner : corners) CHECK(corner < count);
    if (determinant < 0) std::swap(corners[1], corners[2]);  // mirrored
    if (part.normals.empty()) {
      const auto begin = static_cast<uint32_t>(model_.vertices.size());
      for (const uint32_t corner : corners) model_.vertices.push_back(vertexFrom(corner));
      corners = {begin, begin + 1, begin + 2};
      flatten(corners);
    } else {
      for (uint32_t& corner : corners) corner += static_cast<uint32_t>(first);
    }
    model_.corners.insert(model_.corners.end(), corners.begin(), corners.end());
  }
}

// Gives the corners of a triangle its own normal.
void ModelAssembler::flatten(std::array<uint32_t, 3>& corners) {
  ModelVertex* v[3];
  for (size_t k = 0; k < 3; ++k) v[k] = &model_.vertices[corners[k]];
  const Vec3f across = (v[1]->position - v[0]->position).cross(v[2]->position - v[0]->position);
  if (!(across.squaredNorm() > 0) || !across.allFinite()) return;
  for (ModelVertex* vertex : v) vertex->normal = across.normalized();
}

Model ModelAssembler::finish() {
  if (model_.corners.empty()) refuse("", "holds nothing to draw", "export it again, with its meshes");
  return std::move(model_);
}

}  // namespace tessera
