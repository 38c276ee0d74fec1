#include "representations/mesh/train/extraction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "representations/mesh/testing/cube_training.h"

namespace tessera {
namespace {

TEST(Extraction, KeepsTheFacesThatPhotosSee) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig();
  config.finalShare = 0;
  CubeTraining trained(scene, config, 400);
  MeshModel& model = trained.trainer->model();
  const double before = heldOutPsnr(scene, model);
  ExtractionSettings few;
  few.photoStride = 4;
  few.raysPerCell = 0;
  ExtractionSettings photos = few;
  photos.photoStride = 1;
  ExtractionSettings all = photos;
  all.raysPerCell = 2;
  const FaceSet some = extractFaces(model, 0, scene.capture(), nullptr, few),
                most = extractFaces(model, 0, scene.capture(), nullptr, photos),
                faces = extractFaces(model, 0, scene.capture(), nullptr, all);
  EXPECT_GT(some.count(), 50u);
  EXPECT_LT(some.count(), most.count());
  EXPECT_LT(most.count(), faces.count());
  EXPECT_LT(faces.count(), 20 * model.level(0).domain().grids[0].cells() / 10);
  for (uint32_t face = 0; face < 20 * model.level(0).domain().grids[0].cells(); ++face) {
    EXPECT_LE(some.contains(face), most.contains(face)) << "rays were added";
    EXPECT_LE(most.contains(face), faces.contains(face)) << "rays were added";
  }
  ExtractionSettings dilated = few;
  dilated.dilation = 1;
  const FaceSet wider = extractFaces(model, 0, scene.capture(), nullptr, dilated);
  EXPECT_GT(wider.count(), some.count() * 11 / 10) << "triangles beside them that no ray sees";
  EXPECT_LT(wider.count(), some.count() * 4);
  const FaceSet beside = some.neighbours(model.level(0).domain().grids);
  for (const uint32_t face : wider.numbers()) EXPECT_TRUE(some.contains(face) || beside.contains(face));
  model.level(0).keepFaces(faces.bits());
  const double withAll = heldOutPsnr(scene, model);
  EXPECT_GT(withAll, before - 1.5);
  ExtractionSettings economic = all;
  economic.droppedShare = 0.01;
  const FaceSet fewer = extractFaces(model, 0, scene.capture(), nullptr, economic);
  EXPECT_LT(fewer.count(), faces.count() * 9 / 10);
  for (const uint32_t face : fewer.numbers()) EXPECT_TRUE(faces.contains(face));
  model.level(0).keepFaces(fewer.bits());
  EXPECT_GT(heldOutPsnr(scene, model), withAll - 0.3) << "what contributes least was dropped";
  model.level(0).keepFaces(FaceSet(model.level(0).domain().grids).bits());
  EXPECT_LT(heldOutPsnr(scene, model), before - 3) << "without faces nothing is left";
  model.level(0).keepFaces({});
  EXPECT_EQ(heldOutPsnr(scene, model), before);
}

// Traces rays by the model, and composites their hits in double precision.
class HitReader {
 public:
  // (face, opacity, accumulated opacity before the hit)
  using Use = std::function<void(uint32_t, double, double)>;

  HitReader(MeshModel& model, uint32_t maxRays)
      : model_(model),
        hits_(model.device(), maxRays, maxRays * kMaxHits),
        counters_(model.device().array<uint32_t>(MeshHits::kCounters)),
        logits_(model.device().array<float>(size_t{maxRays} * kMaxHits)) {
    hits_.counters = counters_;
    model.field().reserve(maxRays * kMaxHits);
  }

  void read(const MeshRays& rays, const Use& use) {
    Device& device = model_.device();
    model_.level(0).trace(rays, kMaxHits, false, hits_);
    model_.field().encode(hits_.samples(), hits_.positions, Matrix<float>(logits_, 1));
    const std::vector<float> all = device.read(logits_.all());
    const std::vector<uint32_t> first = device.read(hits_.firstSample.all()), faces = device.read(hits_.faces.all());
    for (uint32_t ray = 0; ray < rays.count; ++ray) {
      double transmittance = 1;
      for (uint32_t i = first[ray]; i < first[ray + 1]; ++i) {
        const double opacity = 1 / (1 + std::exp(-static_cast<double>(all[i] + model_.opacityOffset())));
        use(faces[i], opacity, 1 - transmittance);
        transmittance *= 1 - opacity;
      }
    }
  }

 private:
  static constexpr uint32_t kMaxHits = 256;  // of a ray
  MeshModel& model_;
  MeshHits hits_;
  Array<uint32_t> counters_;
  Array<float> logits_;
};

// Follows the rays of all pixels of training photos.
void forEachHit(const CubeScene& scene, MeshModel& model, const HitReader::Use& use) {
  constexpr uint32_t kRays = CubeScene::kWidth * CubeScene::kHeight;
  Device& device = model.device();
  HitReader reader(model, kRays);
  for (const int index : scene.capture().photosIn(Split::train)) {
    const Photo& photo = scene.capture().photos[index];
    const Vec3f eye = model.frame().sceneFromWorld(photo.worldFromCamera.translation).cast<float>();
    std::vector<float> origins, directions;
    for (int y = 0; y < CubeScene::kHeight; ++y)
      for (int x = 0; x < CubeScene::kWidth; ++x) {
        const Vec3d inCamera = *scene.capture().cameras[photo.camera].directionInCamera({x + 0.5, y + 0.5});
        const Vec3f direction =
            (model.frame().rotation * (photo.worldFromCamera.rotation * inCamera)).normalized().cast<float>();
        origins.insert(origins.end(), eye.begin(), eye.end());
        directions.insert(directions.end(), direction.begin(), direction.end());
      }
    const Array<float> from = device.uploadArray(origins), along = device.uploadArray(directions);
    reader.read({kRays, from, along, {}}, use);
  }
}

// Follows parallel rays from above: straight down, and from 8 directions each at 60°, 45° and 30° above the horizon.
void forEachHitOfParallelRays(MeshModel& model, double spacing, const HitReader::Use& use) {
  Device& device = model.device();
  std::vector<Vec3d> backwards{Vec3d::UnitZ()};
  for (const double height : {std::sqrt(0.75), std::sqrt(0.5), 0.5})
    for (int eighth = 0; eighth < 8; ++eighth)
      backwards.push_back(Eigen::AngleAxisd(eighth * EIGEN_PI / 4, Vec3d::UnitZ()) *
                          Vec3d(std::sqrt(1 - height * height), 0, height));
  const int rays = static_cast<int>(2 * std::sqrt(3.0) / spacing) + 1;  // along each side of their square
  HitReader reader(model, static_cast<uint32_t>(rays));
  for (const Vec3d& direction : backwards) {
    const bool vertical = direction.z() == 1;
    const Vec3d right = vertical ? Vec3d(1, 0, 0) : Vec3d(Vec3d::UnitZ().cross(direction).normalized());
    const Vec3d up = direction.cross(right);
    for (int row = 0; row < rays; ++row) {
      std::vector<float> origins, directions;
      for (int column = 0; column < rays; ++column) {
        const Vec3d origin = (column * spacing - std::sqrt(3.0)) * right + (row * spacing - std::sqrt(3.0)) * up +
                             2 * std::sqrt(3.0) * direction;
        for (int axis = 0; axis < 3; ++axis) {
          origins.push_back(static_cast<float>(origin[axis]));
          directions.push_back(static_cast<float>(-direction[axis]));
        }
      }
      const Array<float> from = device.uploadArray(origins), along = device.uploadArray(directions);
      reader.read({static_cast<uint32_t>(rays), from, along, {}}, use);
    }
  }
}

// `faces` were kept because rays see them, those whose hits forEach passes to its argument.
void expectWitnesses(MeshModel& model, const FaceSet& faces, const ExtractionSettings& settings,
                     const std::function<void(const HitReader::Use&)>& forEach) {
  constexpr double kRounding = 1e-3;
  FaceSet clear(model.level(0).domain().grids), possible(model.level(0).domain().grids);
  forEach([&](uint32_t face, double opacity, double before) {
    if (opacity >= settings.minOpacity + kRounding && before <= settings.maxOpacity - kRounding) clear.add(face);
    if (opacity >= settings.minOpacity - kRounding && before <= settings.maxOpacity + kRounding) possible.add(face);
  });
  EXPECT_GT(clear.count(), 100u);
  for (const uint32_t face : clear.numbers()) EXPECT_TRUE(faces.contains(face)) << "a ray sees it";
  for (const uint32_t face : faces.numbers()) EXPECT_TRUE(possible.contains(face)) << "no ray sees it";
}

TEST(Extraction, KeepsExactlyTheFacesWithAWitnessRay) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig();
  config.finalShare = 0;
  CubeTraining trained(scene, config, 300);
  MeshModel& model = trained.trainer->model();
  ExtractionSettings photos;
  photos.raysPerCell = 0;
  expectWitnesses(model, extractFaces(model, 0, scene.capture(), nullptr, photos), photos,
                  [&](const HitReader::Use& use) { forEachHit(scene, model, use); });
  const std::vector<TileShares> nothing(scene.capture().photos.size());
  ExtractionSettings parallel;
  parallel.raysPerCell = 1.5;
  const double spacing = 2.0 / model.level(0).domain().grids[0].resolution / parallel.raysPerCell;
  expectWitnesses(model, extractFaces(model, 0, scene.capture(), &nothing, parallel), parallel,
                  [&](const HitReader::Use& use) { forEachHitOfParallelRays(model, spacing, use); });
}

TEST(Extraction, AddsOnlyQuadsBesideQuads) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig();
  config.finalShare = 0;
  config.quads = true;
  CubeTraining trained(scene, config, 200);
  MeshModel& model = trained.trainer->model();
  ExtractionSettings few;
  few.photoStride = 4;
  few.raysPerCell = 0;
  ExtractionSettings dilated = few;
  dilated.dilation = 2;
  const FaceSet faces = extractFaces(model, 0, scene.capture(), nullptr, few),
                wider = extractFaces(model, 0, scene.capture(), nullptr, dilated);
  EXPECT_GT(wider.count(), faces.count());
  const FaceSet quads = FaceSet::quads(model.level(0).domain().grids);
  for (const uint32_t face : wider.numbers()) EXPECT_TRUE(quads.contains(face));
}

TEST(Extraction, CountsThePixelsThatFacesDoNotCover) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig();
  config.finalShare = 0;
  CubeTraining trained(scene, config, 400);
  MeshModel& model = trained.trainer->model();
  std::vector<TileShares> tiles(scene.capture().photos.size());
  constexpr uint32_t kEdge = 4, kLeft = CubeScene::kWidth / 2 - 8, kTop = CubeScene::kHeight / 2 - 8;  // on the cube
  uint64_t pixels = 0;
  for (const int photo : scene.capture().photosIn(Split::train))
    for (uint32_t i = 0; i < 16; ++i, ++pixels) {
      const uint32_t left = kLeft + kEdge * (i % 4), top = kTop + kEdge * (i / 4);
      tiles[photo].tiles.push_back({photo, left, top, left + kEdge, top + kEdge});
      tiles[photo].until.push_back(tiles[photo].total() + kEdge * kEdge);
    }
  MeshAtlas atlas;
  atlas.patchEdge = 8;
  atlas.faces = extractFaces(model, 0, scene.capture(), nullptr, {});
  model.setAtlas(atlas);
  const SurfaceCoverage all = checkCoverage(model, scene.capture(), tiles);
  EXPECT_EQ(all.pixels, pixels);
  EXPECT_LT(all.holes, pixels / 20);
  model.removeAtlas();
  atlas.faces = FaceSet(model.level(0).domain().grids);
  model.setAtlas(std::move(atlas));
  EXPECT_EQ(checkCoverage(model, scene.capture(), tiles).holes, pixels) << "nothing is left";
}

}  // namespace
}  // namespace tessera
