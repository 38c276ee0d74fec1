#include "export/mobilenerf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <regex>

#include "base/error.h"
#include "base/image_io.h"
#include "base/random.h"
#include "base/threads.h"
#include "export/atomic_folder.h"
#include "export/mesh_level.h"
#include "representations/mesh/content/infer_maps.h"

namespace tessera {
namespace {

constexpr float kOpaqueFrom = 0.5f;
constexpr uint32_t kTexelsOfPatch = 4;        // that are looked at to find some to train on
constexpr double kLeastElevation = 15;        // degrees above the horizon, of cameras that see a block
constexpr const char* kFolderEnd = "_phone";  // the viewer opens <obj>_phone

bool isMobilenerfFile(const std::string& name) {
  static const std::regex kNames("mlp\\.json|shape[0-9]+\\.(obj|pngfeat[01]\\.png)");
  return std::regex_match(name, kNames);
}

MeshContent readForViewer(const MeshLevel& level, const LevelContent& listed, int threads) {
  MeshContent mesh = contentAs<MeshContent>(*level.read(listed));
  inferMapsOnCpu(mesh, threads);
  return mesh;
}

// Draws the directions from which texels are seen. Those of blocks are seen from all directions at least 15° above the
// horizon alike, those of the background block from places above the region, which photos are taken from. A direction
// counts as much as the area that it shows of the texel.
class TexelViews {
 public:
  explicit TexelViews(const SceneBox& region) : region_(region) {}

  void draw(const PatchSet& part, uint32_t patch, bool isBackground, uint64_t number, RefitTexel& texel) const {
    const Vec3d first = part.corner(patch, 0);
    const Vec3d across = part.corner(patch, 1) - first, down = part.corner(patch, 2) - first;
    const Vec3d normal = across.cross(down).normalized();  // zero for a triangle without area
    const RandomStream random(number, 0x7669);
    for (uint32_t i = 0; i < RefitTexel::kDirections; ++i) {
      const auto drawn = [&](uint32_t axis) { return random.uniformDouble(3 * i + axis); };
      const Vec3d direction = isBackground ? toOutside(first + (across + down) / 3, drawn) : downwards(drawn);
      for (int axis = 0; axis < 3; ++axis)
        texel.directions[i][static_cast<size_t>(axis)] = static_cast<float>(direction[axis]);
      texel.weights[i] = static_cast<float>(std::abs(normal.dot(direction)));
    }
  }

 private:
  template <class Drawn>
  static Vec3d downwards(const Drawn& drawn) {
    const double lowest = std::sin(kLeastElevation * std::numbers::pi / 180), z = lowest + (1 - lowest) * drawn(0),
                 turn = 2 * std::numbers::pi * drawn(1), radius = std::sqrt(1 - z * z);
    return {radius * std::cos(turn), radius * std::sin(turn), -z};
  }
  template <class Drawn>
  Vec3d toOutside(const Vec3d& place, const Drawn& drawn) const {
    const Vec3d size = region_.high - region_.low;
    const double height = std::max(size.x(), size.y()) / 4;
    const Vec3d camera(region_.low.x() + size.x() * drawn(0), region_.low.y() + size.y() * drawn(1),
                       region_.high.z() + height * drawn(2));
    return (place - camera).normalized();
  }

  SceneBox region_;
};

// Passes opaque texels of all patches to the refit.
class TexelSurvey {
 public:
  TexelSurvey(const Tileset& tileset, ViewerRefit& refit) : views_(tileset.box()), refit_(refit) {}

  void add(const PatchSet& part, bool isBackground) {
    const uint32_t decoder = refit_.numberDecoder(part.decoder);
    const RandomStream random(0x7465);
    for (uint32_t patch = 0; patch < part.patches; ++patch) {
      for (uint32_t i = 0; i < kTexelsOfPatch; ++i, ++drawn_) {
        uint32_t column = random.below(2 * drawn_, part.patchEdge), row = random.below(2 * drawn_ + 1, part.patchEdge);
        if (patch >= part.pairs && column + row >= part.patchEdge) {  // the half that no triangle shows
          column = part.patchEdge - 1 - column;
          row = part.patchEdge - 1 - row;
        }
        const MeshTexel mixed = mixTexels(part, patch, static_cast<float>(column), static_cast<float>(row));
        if (mixed.opacity < kOpaqueFrom) continue;
        RefitTexel texel;
        texel.features = mixed.features;
        views_.draw(part, patch, isBackground, drawn_, texel);
        refit_.add(decoder, texel);
        isAny_ = true;
      }
    }
  }
  bool isAny() const { return isAny_; }

 private:
  TexelViews views_;
  ViewerRefit& refit_;
  uint64_t drawn_ = 0;
  bool isAny_ = false;
};

// The triangles of a part. Corners lie at the centres of texels, as in the scene, so that the viewer, which takes the
// nearest texel, never takes one of a neighbouring patch.
std::string writeObj(const PatchSet& part, const Similarity& viewerFromScene) {
  std::string text;
  auto to = std::back_inserter(text);
  uint64_t written = 0;
  const double width = part.textureWidth(), height = part.textureHeight();
  for (uint32_t patch = 0; patch < part.patches; ++patch) {
    const uint32_t corners = patch < part.pairs ? 4 : 3, across = part.patchesAcross();
    for (uint32_t corner = 0; corner < corners; ++corner) {
      const Vec3d at = viewerFromScene * part.corner(patch, corner);
      fmt::format_to(to, "v {:.7g} {:.7g} {:.7g}\n", at.x(), at.y(), at.z());
    }
    for (uint32_t corner = 0; corner < corners; ++corner) {
      const uint32_t last = part.patchEdge - 1;
      const double column = part.patchEdge * (patch % across) + (corner % 2 == 1 ? last : 0) + 0.5,
                   row = part.patchEdge * (patch / across) + (corner / 2 == 1 ? last : 0) + 0.5;
      fmt::format_to(to, "vt {:.7g} {:.7g}\n", column / width, 1 - row / height);
    }
    const auto face = [&](uint64_t a, uint64_t b, uint64_t c) {
      fmt::format_to(to, "f {0}/{0} {1}/{1} {2}/{2}\n", written + a, written + b, written + c);
    };
    face(1, 2, 3);
    if (corners == 4) face(4, 3, 2);
    written += corners;
  }
  return text;
}

// Returns the textures of features 0 to 3 and 4 to 7.
std::array<ImageU8, 2> makeTextures(const PatchSet& part, ViewerRefit& refit, ThreadPool& pool) {
  const uint32_t decoder = refit.numberDecoder(part.decoder), edge = part.patchEdge, across = part.patchesAcross();
  const size_t texels = size_t{edge} * edge;
  std::array<ImageU8, 2> images;
  for (ImageU8& image : images) {
    image = ImageU8(static_cast<int>(part.textureWidth()), static_cast<int>(part.textureHeight()), 4);
    for (size_t alpha = 3; alpha < image.pixels.size(); alpha += 4) image.pixels[alpha] = 128;
  }
  constexpr uint32_t kPatchesAtATime = 1024;
  std::vector<float> features, opacities;
  for (uint32_t first = 0; first < part.patches; first += kPatchesAtATime) {
    const uint32_t count = std::min(kPatchesAtATime, part.patches - first);
    features.resize(count * texels * kMeshFeatures);
    opacities.resize(count * texels);
    pool.forRanges(count, 16, [&](size_t begin, size_t end) {
      for (size_t i = begin * texels; i < end * texels; ++i) {
        const size_t texel = i % texels;
        const MeshTexel mixed = mixTexels(part, first + static_cast<uint32_t>(i / texels),
                                          static_cast<float>(texel % edge), static_cast<float>(texel / edge));
        std::copy(mixed.features.begin(), mixed.features.end(),
                  features.begin() + static_cast<ptrdiff_t>(kMeshFeatures * i));
        opacities[i] = mixed.opacity;
      }
    });
    const std::vector<uint8_t> bytes = refit.encode(decoder, features);
    for (size_t i = 0; i < opacities.size(); ++i) {
      if (opacities[i] < kOpaqueFrom) continue;
      const uint32_t patch = first + static_cast<uint32_t>(i / texels), texel = static_cast<uint32_t>(i % texels);
      const int x = static_cast<int>(patch % across * edge + texel % edge),
                y = static_cast<int>(patch / across * edge + texel / edge);
      for (size_t image = 0; image < 2; ++image)
        std::copy_n(bytes.begin() + static_cast<ptrdiff_t>(kViewerFeatures * i + 4 * image), 4, images[image].at(x, y));
    }
  }
  return images;
}

std::string describeNetwork(const std::vector<DenseLayer>& layers, uint32_t shapes) {
  nlohmann::ordered_json json;
  for (size_t i = 0; i < layers.size(); ++i) {
    nlohmann::ordered_json rows = nlohmann::ordered_json::array();
    for (uint32_t input = 0; input < layers[i].inputs; ++input) {
      nlohmann::ordered_json row = nlohmann::ordered_json::array();
      for (uint32_t output = 0; output < layers[i].outputs; ++output)
        row.push_back(layers[i].weights[output * layers[i].inputs + input]);
      rows.push_back(std::move(row));
    }
    json[fmt::format("{}_weights", i)] = std::move(rows);
    json[fmt::format("{}_bias", i)] = layers[i].biases;
  }
  json["obj_num"] = shapes;
  return json.dump() + "\n";
}

}  // namespace

Similarity viewerFromScene(const Tileset& tileset) {
  const SceneBox box = tileset.box();
  Similarity viewer;
  viewer.rotation << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  viewer.scale = 2 / std::max(box.high.x() - box.low.x(), box.high.y() - box.low.y());
  viewer.translation = -viewer.scale * (viewer.rotation * (box.low + box.high) / 2);
  return viewer;
}

MobilenerfExport exportMobilenerf(const fs::path& scene, const fs::path& out,
                                  const MobilenerfExportSettings& settings) {
  const std::string name = (out.has_filename() ? out : out.parent_path()).filename().string();
  if (!name.ends_with(kFolderEnd) || name == kFolderEnd) {
    throw Error(out.string(), "", "is not the name of a folder that MobileNeRF's viewer opens",
                "name a folder that ends in _phone; the viewer opens NAME_phone with ?obj=NAME");
  }
  const MeshLevel level(scene, settings.level, "mobilenerf");
  AtomicFolder folder(out, isMobilenerfFile);
  ViewerRefit refit(settings.threads);
  TexelSurvey survey(level.tileset(), refit);
  for (const LevelContent& listed : level.contents()) {
    const MeshContent mesh = readForViewer(level, listed, settings.threads);
    for (const PatchSet& part : mesh.parts)
      if (part.patches > 0) survey.add(part, mesh.isBackground);
  }
  if (!survey.isAny()) throw Error(scene.string(), "", "contains no opaque triangles", "train longer, and bake again");
  MobilenerfExport exported;
  exported.decoders = refit.decoders();
  exported.refit = refit.train(settings.refitSteps);

  ThreadPool pool(settings.threads);
  const auto write = [&](const std::string& file, const auto& bytes) {
    writeFileAtomically(folder.path() / file, bytes, true);
    exported.bytesOnDisk += bytes.size();
  };
  for (const LevelContent& listed : level.contents()) {
    const MeshContent mesh = readForViewer(level, listed, settings.threads);
    for (const PatchSet& part : mesh.parts) {
      if (part.patches == 0) continue;
      const std::string shape = fmt::format("shape{}", exported.shapes++);
      write(shape + ".obj", writeObj(part, viewerFromScene(level.tileset())));
      const std::array<ImageU8, 2> textures = makeTextures(part, refit, pool);
      for (size_t i = 0; i < 2; ++i) write(fmt::format("{}.pngfeat{}.png", shape, i), encodePng(textures[i]));
      exported.triangles += part.triangles();
    }
  }
  write("mlp.json", describeNetwork(refit.network(), exported.shapes));
  folder.commit();
  return exported;
}

}  // namespace tessera
