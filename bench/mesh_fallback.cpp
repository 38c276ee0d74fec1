// What programs show of the ordinary meshes in a mesh scene's contents, against the renderer on the CPU.
//   mesh_fallback views SCENE CAPTURE FOLDER      writes views.json: the contents of the finest level with their
//                                                 numbers of triangles, and the held-out cameras in their axes (Y up)
//   mesh_fallback compare SCENE CAPTURE FOLDER    prints JSON: mean PSNR and SSIM of pictures with each other
// CAPTURE holds photos of the scene's place without distortion. FOLDER has pictures of programs, VIEW-PROGRAM.png;
// where they are transparent, the scene's sky is put behind them. They are compared with
//   oracle   the scene as the CPU renders it
//   plain    the same without view dependence: all hits composited, each with the base colour of its texels
//   cut      the ordinary mesh by Embree, as glTF defines it: the nearest hit with an opacity of at least
//   kFallbackAlphaCutoff photo    the held-out photo
// and these with each other. Writes VIEW-oracle.png, VIEW-plain.png and VIEW-cut.png. See mesh.sh.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/error.h"
#include "base/image_io.h"
#include "base/threads.h"
#include "bench/evaluation.h"
#include "bench/mesh_scene.h"
#include "eval/lpips.h"
#include "eval/psnr.h"
#include "eval/ssim.h"
#include "import/capture_reader.h"
#include "representations/mesh/content/fallback_mesh.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_drawer.h"
#include "representations/mesh/cpu/mesh_tracer.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

struct FinestContent {
  std::string uri;
  bool isBackground = false;
};
std::vector<FinestContent> listContents(const Tileset& tileset) {
  std::vector<FinestContent> list;
  for (const Tile& tile : tileset.tiles)
    for (const TileContent& content : tile.contents)
      if ((content.backgroundBlock ? content.level : tile.level) == 0)
        list.push_back({content.uri, content.backgroundBlock});
  return list;
}

// Returns the base colour textures of a content's parts; those of parts without patches are empty.
std::vector<ImageU8> readTextures(const fs::path& glb, const MeshContent& content) {
  const Bytes bytes = readFile(glb);
  // The JSON of a glTF file begins after the headers of the file and of its first chunk.
  uint32_t length = 0;
  std::memcpy(&length, bytes.data() + 12, sizeof(length));
  const auto* text = reinterpret_cast<const char*>(bytes.data()) + 20;
  const Json asset = Json::parse(text, text + length);
  std::vector<ImageU8> textures;
  size_t image = 0;
  for (const PatchSet& part : content.parts)
    textures.push_back(part.patches == 0
                           ? ImageU8()
                           : readImage(glb.parent_path() / asset["images"][image++]["uri"].get<std::string>()).image);
  return textures;
}

// Colours are mixed in linear light, as glTF requires.
float linearFromByte(uint8_t byte) {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i) {
      const float v = static_cast<float>(i) / 255;
      values[i] = v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f);
    }
    return values;
  }();
  return table[byte];
}
float srgbFromLinear(float v) {
  return v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
}

struct LoadedContent {
  std::unique_ptr<Content> content;
  std::vector<ImageU8> textures;
  std::unique_ptr<MeshTracer> tracer;
  bool isBackground = false;

  const MeshContent& mesh() const { return contentAs<MeshContent>(*content); }
};

// The scene without view dependence, composited or cut.
class BaseColourRenderer final : public ViewRenderer, private HitShading {
 public:
  BaseColourRenderer(const fs::path& folder, const Tileset& tileset) : frame_(makeTileFrame(tileset)) {
    for (const FinestContent& listed : listContents(tileset)) {
      const fs::path path = contentPath(folder, listed.uri);
      LoadedContent loaded{readContent(path, meshCodec()), {}, nullptr, listed.isBackground};
      loaded.textures = readTextures(path, loaded.mesh());
      std::vector<PatchTriangles> triangles;
      for (const PatchSet& part : loaded.mesh().parts) triangles.push_back(makePatchTriangles(part));
      loaded.tracer = std::make_unique<MeshTracer>(triangles);
      contents_.push_back(std::move(loaded));
    }
  }
  bool isCut = false;

  RenderedView render(const Camera& camera, const Pose& pose, const ImageF*) override {
    RenderedView view = makeEmptyView(camera);
    const Mat3d sceneFromCamera = frame_.rotation.transpose() * pose.rotation;
    const Vec3d origin = frame_.inScene(pose.translation);
    pool_.run(static_cast<size_t>(camera.height), [&](size_t row, int) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < camera.width; ++x) {
        const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
        if (!inCamera) continue;
        const SceneRay along{origin, (sceneFromCamera * *inCamera).normalized()};
        const CompositedRay ray = isCut ? cut(along) : composite(along);
        const std::array<float, 3> behind = sky(along.direction);
        for (int c = 0; c < 3; ++c) view.colour.at(x, y)[c] = ray.colour[c] + ray.transmittance * behind[c];
        *view.opacity.at(x, y) = 1;
      }
    });
    return view;
  }
  std::string device() const override { return "Embree"; }

  std::array<float, 3> sky(const Vec3d& directionInScene) const {
    for (const LoadedContent& loaded : contents_)
      if (loaded.isBackground && loaded.mesh().skyEdge > 0) return skyColour(loaded.mesh(), directionInScene);
    return {};
  }
  const TileFrame& frame() const { return frame_; }
  uint64_t triangles(size_t content) const { return contents_[content].mesh().triangles(); }

 private:
  // Feature c is the logit of base colour c, which `decoder` passes on.
  MeshTexel texel(const MeshHit& hit) const override {
    const ImageU8& texture = contents_[hit.content].textures[hit.part];
    const PatchSet& part = contents_[hit.content].mesh().parts[hit.part];
    const uint32_t edge = part.patchEdge, across = part.patchesAcross();
    const float column = hit.column * static_cast<float>(edge - 1), row = hit.row * static_cast<float>(edge - 1);
    const uint32_t i = std::min(static_cast<uint32_t>(column), edge - 2),
                   j = std::min(static_cast<uint32_t>(row), edge - 2);
    std::array<float, 4> sum{};
    for (const uint32_t dy : {0u, 1u})
      for (const uint32_t dx : {0u, 1u}) {
        const uint8_t* bytes = texture.at(static_cast<int>(hit.patch % across * edge + i + dx),
                                          static_cast<int>(hit.patch / across * edge + j + dy));
        const float fx = column - static_cast<float>(i), fy = row - static_cast<float>(j),
                    weight = (dx == 1 ? fx : 1 - fx) * (dy == 1 ? fy : 1 - fy);
        for (int c = 0; c < 3; ++c) sum[c] += weight * linearFromByte(bytes[c]);
        sum[3] += weight * static_cast<float>(bytes[3]) / 255;
      }
    MeshTexel mixed;
    mixed.opacity = sum[3];
    for (int c = 0; c < 3; ++c) {
      const float colour = std::clamp(srgbFromLinear(sum[c]), 1e-4f, 1 - 1e-4f);
      mixed.features[c] = std::log(colour / (1 - colour));
    }
    if (isCut) mixed.opacity = mixed.opacity >= kFallbackAlphaCutoff ? 1 : 0;
    return mixed;
  }
  const DenseNetwork& decoder(const MeshHit&) const override { return passing_; }
  static DenseNetwork makePassing() {
    constexpr uint32_t kInputs = kMeshFeatures + kMeshHarmonics;
    DenseLayer layer{kInputs, 3, std::vector<float>(3 * kInputs), std::vector<float>(3)};
    for (uint32_t c = 0; c < 3; ++c) layer.weights[c * kInputs + c] = 1;
    return DenseNetwork({layer}, kInputs, 3);
  }

  void addHits(const SceneRay& ray, bool ofBackground, double near, std::vector<MeshHit>& hits) const {
    for (uint32_t i = 0; i < contents_.size(); ++i) {
      if (contents_[i].isBackground != ofBackground) continue;
      const size_t first = hits.size();
      contents_[i].tracer->addHits(ray.origin.cast<float>(), ray.direction.cast<float>(), static_cast<float>(near),
                                   static_cast<float>(TileFrame::kSceneEnd), hits);
      for (size_t h = first; h < hits.size(); ++h) hits[h].content = i;
    }
  }
  CompositedRay composite(const SceneRay& along) const {
    std::vector<MeshHit> hits, behind;
    addHits(along, false, frame_.near, hits);
    const RayRange inside = clipToBox(along, frame_.low, frame_.high, {frame_.near, TileFrame::kSceneEnd});
    addHits(along, true, inside.empty() ? frame_.near : inside.far, behind);
    CompositedRay ray;
    compositeHits(hits, along.direction, 1e-3f, *this, ray);
    compositeHits(behind, along.direction, 1e-3f, *this, ray);
    return ray;
  }
  // Other programs know no order of contents: the background block is one of them.
  CompositedRay cut(const SceneRay& along) const {
    std::vector<MeshHit> hits;
    addHits(along, false, frame_.near, hits);
    addHits(along, true, frame_.near, hits);
    CompositedRay ray;
    compositeHits(hits, along.direction, 0.5f, *this, ray);
    return ray;
  }

  TileFrame frame_;
  std::vector<LoadedContent> contents_;
  DenseNetwork passing_ = makePassing();
  ThreadPool pool_{0};
};

// The held-out photos, with poses in the scene's world.
std::vector<Photo> heldOutPhotos(const Capture& capture, const Tileset& tileset) {
  const Mat4d worldFromCapture = tileset.sourceFromWorld.inverse() * capture.sourceFromWorld;
  std::vector<Photo> photos;
  for (const int number : capture.photosIn(Split::test)) {
    Photo photo = capture.photos[number];
    if (capture.cameras[photo.camera].lens != LensModel::pinhole)
      throw Error(capture.root.string(), "", "its lens is distorted", "make the city with --pinhole");
    Pose& pose = photo.worldFromCamera;
    pose.translation = (worldFromCapture * pose.translation.homogeneous()).head<3>();
    pose.rotation = worldFromCapture.topLeftCorner<3, 3>() * pose.rotation;
    pose.rotation /= std::cbrt(pose.rotation.determinant());
    photos.push_back(photo);
  }
  return photos;
}
std::string viewName(const Photo& photo) {
  return fs::path(photo.name).stem().string();
}

void writeViews(const fs::path& folder, const fs::path& captureFolder, const fs::path& to) {
  const Tileset tileset = readTileset(folder);
  const Capture capture = readCapture(captureFolder);
  Json views;
  views["near"] = tileset.tileFromScene().scale * tileset.near;
  views["far"] = 1000 * tileset.tileFromScene().scale * std::max(tileset.columns, tileset.rows);
  const BaseColourRenderer renderer(folder, tileset);
  const std::vector<FinestContent> contents = listContents(tileset);
  for (size_t i = 0; i < contents.size(); ++i)
    views["contents"].push_back({{"uri", contents[i].uri}, {"triangles", renderer.triangles(i)}});
  const Mat4d tileFromWorld = tileset.georeference ? tileset.georeference->enuFromWorld : Mat4d::Identity();
  Mat4d yUp = Mat4d::Zero();
  yUp(0, 0) = yUp(1, 2) = yUp(3, 3) = 1;
  yUp(2, 1) = -1;
  for (const Photo& photo : heldOutPhotos(capture, tileset)) {
    const Camera& camera = capture.cameras[photo.camera];
    Mat4d pose = Mat4d::Identity();
    pose.topLeftCorner<3, 3>() = photo.worldFromCamera.rotation * Vec3d(1, -1, -1).asDiagonal();  // right, up, back
    pose.topRightCorner<3, 1>() = photo.worldFromCamera.translation;
    Mat4d matrix = yUp * tileFromWorld * pose;
    matrix.topLeftCorner<3, 3>() /= std::cbrt(matrix.topLeftCorner<3, 3>().determinant());
    views["views"].push_back({{"name", viewName(photo)},
                              {"width", camera.width},
                              {"height", camera.height},
                              {"focal", {camera.focalX(), camera.focalY()}},
                              {"centre", {camera.centreX(), camera.centreY()}},
                              {"matrix", std::vector<double>(matrix.data(), matrix.data() + 16)}});  // by columns
  }
  fs::create_directories(to);
  writeFileAtomically(to / "views.json", views.dump(1));
}

// Returns the picture of a program, with the sky where it is transparent; nothing if there is none.
std::optional<ImageF> readPicture(const fs::path& file, const Camera& camera, const Pose& pose,
                                  const BaseColourRenderer& renderer) {
  if (!fs::exists(file)) return std::nullopt;
  const ImageU8 picture = readImage(file).image;
  if (picture.width != camera.width || picture.height != camera.height || picture.channels != 4)
    throw Error(file.string(), "", "is not a picture of the photo's size with four channels", "render it again");
  ImageF image(camera.width, camera.height, 3);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d direction = pose.rotation * *camera.directionInCamera({x + 0.5, y + 0.5});
      const std::array<float, 3> sky = renderer.sky((renderer.frame().rotation.transpose() * direction).normalized());
      const float opacity = static_cast<float>(picture.at(x, y)[3]) / 255;
      for (int c = 0; c < 3; ++c)
        image.at(x, y)[c] = opacity * static_cast<float>(picture.at(x, y)[c]) / 255 + (1 - opacity) * sky[c];
    }
  return image;
}

Json compare(const fs::path& folder, const fs::path& captureFolder, const fs::path& pictures) {
  const Tileset tileset = readTileset(folder);
  const Capture capture = readCapture(captureFolder);
  BaseColourRenderer renderer(folder, tileset);
  const OpenedMeshScene scene = openMeshScene(folder, makeMeshDrawer());
  SceneRenderer& oracle = *scene.renderer;
  Json sums = Json::object();
  uint64_t views = 0;
  std::optional<Lpips> lpips;
  if (!lpipsWeights().empty()) lpips.emplace(lpipsWeights());
  ThreadPool pool(0);
  for (const Photo& photo : heldOutPhotos(capture, tileset)) {
    const Camera& camera = capture.cameras[photo.camera];
    const Pose& pose = photo.worldFromCamera;
    std::vector<std::pair<std::string, ImageF>> images = {{"photo", toFloat(readImage(photo.image).image)}};
    const Eigen::Array3f black = Eigen::Array3f::Zero();
    images.emplace_back("oracle", compositeOver(oracle.render(camera, pose, nullptr), black));
    renderer.isCut = false;
    images.emplace_back("plain", renderer.render(camera, pose, nullptr).colour);
    renderer.isCut = true;
    images.emplace_back("cut", renderer.render(camera, pose, nullptr).colour);
    for (const auto& [name, image] : images)
      if (name != "photo") writePng(pictures / (viewName(photo) + "-" + name + ".png"), toBytes(image));
    for (const char* program : {"three", "blender"})
      if (auto picture = readPicture(pictures / (viewName(photo) + "-" + program + ".png"), camera, pose, renderer))
        images.emplace_back(program, std::move(*picture));
    for (size_t a = 1; a < images.size(); ++a)
      for (size_t b = 0; b < a; ++b) {
        Json& sum = sums[images[a].first][images[b].first];
        const double decibels = psnr(images[a].second, images[b].second);
        if (sum.is_null()) sum = {{"psnr", 0.0}, {"ssim", 0.0}};
        sum["psnr"] = sum["psnr"].get<double>() + decibels;
        sum["ssim"] = sum["ssim"].get<double>() + ssim(images[a].second, images[b].second);
        if (lpips) sum["lpips"] = sum.value("lpips", 0.0) + (*lpips)(images[a].second, images[b].second, pool).total;
        sum["views"].push_back(decibels);
      }
    ++views;
  }
  for (auto& [a, others] : sums.items())
    for (auto& [b, sum] : others.items())
      for (const char* key : {"psnr", "ssim", "lpips"})
        if (sum.contains(key)) sum[key] = sum[key].get<double>() / static_cast<double>(sum["views"].size());
  sums["views"] = views;
  return sums;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  const std::string what = argc == 5 ? argv[1] : "";
  if (what != "views" && what != "compare") {
    std::fprintf(stderr, "usage: mesh_fallback views|compare SCENE CAPTURE FOLDER\n");
    return 2;
  }
  try {
    if (what == "views") {
      tessera::writeViews(argv[2], argv[3], argv[4]);
    } else {
      std::printf("%s\n", tessera::compare(argv[2], argv[3], argv[4]).dump(2).c_str());
    }
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_fallback: error: %s\n", error.what());
    return 1;
  }
}
