#include "representations/mesh/bake/bake_mesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "representations/mesh/cpu/mesh_tracer.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/mesh_renderer.h"
#include "representations/mesh/train/mesh_trainer.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

// A square of two triangles in the plane z = 0 with opacity and features that grow along the columns.
BakedPatches bakedSquare() {
  BakedPatches square;
  square.patchEdge = 8;
  square.pairs = 1;
  square.vertices = {0, 0, 0, 7, 0, 0, 0, 7, 0, 7, 7, 0};
  for (uint32_t row = 0; row < 8; ++row)
    for (uint32_t column = 0; column < 8; ++column) {
      for (uint32_t f = 0; f < kMeshFeatures; ++f) square.texels.push_back(static_cast<uint8_t>(10 * column + f));
      square.texels.push_back(static_cast<uint8_t>(30 * column));
    }
  for (uint32_t f = 0; f < kMeshFeatures; ++f) square.ranges[f] = {-1, 1.55f};
  DenseLayer layer;
  layer.inputs = kMeshFeatures + kMeshHarmonics;
  layer.outputs = 3;
  layer.weights.resize(size_t{layer.inputs} * 3);
  layer.biases.resize(3);
  for (int c = 0; c < 3; ++c) layer.weights[size_t{layer.inputs} * c + c] = 1;
  square.decoder = {layer};
  return square;
}

// Shows patches as they are baked.
class BakedShading final : public HitShading {
 public:
  explicit BakedShading(const BakedPatches& patches)
      : patches_(patches), decoder_(patches.decoder, kMeshFeatures + kMeshHarmonics, 3) {}

  MeshTexel texel(const MeshHit& hit) const override {
    const float last = static_cast<float>(patches_.patchEdge - 1);
    return mixTexels(patches_, hit.patch, hit.column * last, hit.row * last);
  }
  const DenseNetwork& decoder(const MeshHit&) const override { return decoder_; }

 private:
  const BakedPatches& patches_;
  DenseNetwork decoder_;
};

MeshTracer makeBakedTracer(const BakedPatches& patches) {
  PatchTriangles triangles;
  triangles.pairs = patches.pairs;
  triangles.vertices.assign(patches.vertices.begin(), patches.vertices.end());
  return MeshTracer(std::span(&triangles, 1));
}

TEST(MeshTracer, FindsAllHitsWithTheirTexelsAndCompositesThem) {
  BakedPatches squares = bakedSquare();
  // A second square above the first.
  const BakedPatches above = bakedSquare();
  squares.vertices.insert(squares.vertices.end(), above.vertices.begin(), above.vertices.end());
  for (int corner = 4; corner < 8; ++corner) squares.vertices[3 * corner + 2] = 1;
  squares.texels.insert(squares.texels.end(), above.texels.begin(), above.texels.end());
  squares.pairs = 2;
  const MeshTracer tracer = makeBakedTracer(squares);
  const BakedShading shading(squares);
  for (const auto& [x, y] : std::vector<std::pair<float, float>>{{1.25f, 0.5f}, {6.25f, 3.0f}, {0.1f, 6.7f}}) {
    std::vector<MeshHit> hits;
    tracer.addHits({x, y, 3}, {0, 0, -1}, 0, 100, hits);
    ASSERT_EQ(hits.size(), 2u) << x;
    for (const MeshHit& hit : hits) {
      EXPECT_NEAR(7 * hit.column, x, 1e-5);
      EXPECT_NEAR(7 * hit.row, y, 1e-5);
      EXPECT_NEAR(hit.distance, hit.patch == 0 ? 3 : 2, 1e-6);
    }
    const float opacity = 30 * x / 255, feature = -1 + 2.55f * 10 * x / 255;
    CompositedRay ray;
    compositeHits(hits, {0, 0, -1}, 0, shading, ray);
    EXPECT_NEAR(ray.transmittance, (1 - opacity) * (1 - opacity), 1e-5);
    EXPECT_NEAR(ray.colour[0], (1 - ray.transmittance) / (1 + std::exp(-feature)), 1e-4);
    EXPECT_NEAR(ray.depth, opacity * 2 + (1 - opacity) * opacity * 3, 1e-5);
    EXPECT_EQ(ray.samples, 2u);
  }
  std::vector<MeshHit> hits;
  tracer.addHits({1, 1, 3}, {0, 0, -1}, 2.4f, 100, hits);
  EXPECT_EQ(hits.size(), 1u) << "near";
  tracer.addHits({8, 1, 3}, {0, 0, -1}, 0, 100, hits);
  EXPECT_EQ(hits.size(), 1u) << "beside";
}

TEST(BakedPatches, ChangeLittleByBlockCompression) {
  BakedPatches patches = bakedSquare();
  patches.texels.clear();
  for (uint32_t i = 0; i < 64; ++i)
    for (uint32_t number = 0; number < BakedPatches::kNumbers; ++number)
      patches.texels.push_back(static_cast<uint8_t>(40 + 7 * (i % 8 % 4) + 3 * (i / 8 % 4) + 10 * number));
  const std::vector<uint8_t> before = patches.texels;
  passThroughBc4(patches, Bc4Effort::fast);
  EXPECT_NE(patches.texels, before);
  for (size_t i = 0; i < before.size(); ++i)
    EXPECT_LE(std::abs(patches.texels[i] - before[i]), 30 / 14 + 1) << "a fourteenth of each number's own range";
}

TEST(BakedPatches, AreTheSameInAPatchSet) {
  BakedPatches patches = bakedSquare();
  const BakedPatches single = bakedSquare();
  patches.vertices.insert(patches.vertices.end(), single.vertices.begin(), single.vertices.end());
  for (int corner = 4; corner < 8; ++corner) patches.vertices[3 * corner + 2] = -2;
  patches.texels.insert(patches.texels.end(), single.texels.begin(), single.texels.end());
  patches.baseColours.assign(2 * 64 * 3, 7);
  passThroughBc4(patches, Bc4Effort::fast);
  const std::vector<uint32_t> numbers = {0, 1};
  const PatchSet set = compressPatches(patches, numbers, {0.5, {10, -20, 30}}, Bc4Effort::fast);
  ASSERT_EQ(set.patches, 2u);
  EXPECT_EQ(set.pairs, 1u);
  EXPECT_EQ(set.textureWidth(), 16u);
  EXPECT_EQ(set.textureHeight(), 8u);
  for (uint32_t patch = 0; patch < 2; ++patch) {
    for (uint32_t number = 0; number < 3; ++number) {
      const Vec3d expected = 0.5 * patches.corner(patch, number) + Vec3d(10, -20, 30);
      EXPECT_LE((set.corner(patch, number) - expected).cwiseAbs().maxCoeff(), set.step / 2 * 1.001);
    }
    for (float column = 0; column <= 7; column += 0.35f)
      for (float row = 0; row <= 7; row += 0.35f) {
        const MeshTexel a = mixTexels(patches, patch, column, row), b = mixTexels(set, patch, column, row);
        EXPECT_NEAR(a.opacity, b.opacity, 0.6 / 255);
        for (uint32_t f = 0; f < kMeshFeatures; ++f) EXPECT_NEAR(a.features[f], b.features[f], 0.6 * 2.55 / 255);
      }
  }
  EXPECT_LE(set.step, 3.5 * 2 / 65533) << "the smallest power of two that suffices";
  const ImageU8 texture = makeBaseColourTexture(patches, numbers, set);
  EXPECT_EQ(texture.at(9, 3)[0], 7);
  EXPECT_EQ(texture.at(9, 3)[3], patches.texels[9 * (64 + 3 * 8 + 1) + 8]);
}

// A baked cube looks as its model does.
TEST(BakeMesh, LooksAsTheModelWithTheSameFaces) {
  const CubeScene scene;
  const auto device = makeDevice({"cpu", 2});
  const MeshPart part{"block_0_0", 0, fitSceneFrame(scene.capture(), 0.5), {1, 1, 1}};
  MeshConfig config = smallMeshConfig();
  config.meshLevels = 1;
  const OctahedraDomain domain = config.domain(part, 0);
  MeshStart start;
  start.cells.assign(domain.grids[0].cells(), true);
  start.tiles.resize(scene.capture().photos.size());
  for (const int photo : scene.capture().photosIn(Split::train))
    start.tiles[photo] = {{{photo, 0, 0, CubeScene::kWidth, CubeScene::kHeight}},
                          {1.0 * CubeScene::kWidth * CubeScene::kHeight}};
  MeshTrainer trainer(*device, scene.capture(), config, part, start);
  constexpr int64_t kSteps = 300;
  for (int64_t step = 0; step < kSteps; ++step) trainer.step(step, kSteps);
  MeshModel& model = trainer.model();
  ExtractionSettings extraction;
  extraction.raysPerCell = 2;
  const FaceSet faces = extractFaces(model, 0, scene.capture(), nullptr, extraction);
  MeshBakeSettings settings;
  settings.patchEdge = 16;
  settings.opaqueFrom = 2;  // as trained
  settings.transparentBelow = 0;
  const BakedPatches content = bakePatches(model, 0, faces, settings);
  EXPECT_LE(content.triangles(), faces.count());
  EXPECT_GT(content.triangles(), faces.count() / 2) << "those within the block";
  EXPECT_GT(content.pairs, content.triangles() / 4);

  model.level(0).keepFaces(faces.bits());
  MeshPartRenderer renderer(model);
  const MeshTracer tracer = makeBakedTracer(content);
  const BakedShading shading(content);
  double squares = 0;
  size_t numbers = 0;
  for (const int index : scene.capture().photosIn(Split::test)) {
    const Photo& photo = scene.capture().photos[index];
    const Camera& camera = scene.capture().cameras[photo.camera];
    const RenderedView view = renderer.render(camera, photo.worldFromCamera, nullptr);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
        const Vec3f direction =
            (part.frame.rotation * (photo.worldFromCamera.rotation * *inCamera)).normalized().cast<float>();
        const Vec3f origin = part.frame.sceneFromWorld(photo.worldFromCamera.translation).cast<float>();
        std::vector<MeshHit> hits;
        tracer.addHits(origin, direction, static_cast<float>(config.near), 1e6f, hits);
        CompositedRay ray;
        compositeHits(hits, direction.cast<double>(), 0, shading, ray);
        for (int c = 0; c < 3; ++c) {
          const double difference = ray.colour[c] - view.colour.at(x, y)[c];
          squares += difference * difference;
          ++numbers;
        }
      }
  }
  EXPECT_GT(-10 * std::log10(squares / static_cast<double>(numbers)), 28);
}

// Trains a cube as one block, and draws rays through its photos.
class AtlasStageTest : public testing::Test {
 protected:
  // Performs the first `performed` of `steps` steps.
  void train(MeshConfig config, int64_t steps, int64_t performed) {
    const MeshPart part{"block_0_0", 0, fitSceneFrame(scene_.capture(), 0.5), {1, 1, 1}};
    MeshStart start;
    start.cells.assign(config.domain(part, 0).grids[0].cells(), true);
    start.tiles.resize(scene_.capture().photos.size());
    for (const int photo : scene_.capture().photosIn(Split::train))
      start.tiles[photo] = {{{photo, 0, 0, CubeScene::kWidth, CubeScene::kHeight}},
                            {1.0 * CubeScene::kWidth * CubeScene::kHeight}};
    trainer_ = std::make_unique<MeshTrainer>(*device_, scene_.capture(), config, part, std::move(start));
    for (int64_t step = 0; step < performed; ++step) trainer_->step(step, steps);
  }
  MeshModel& model() { return trainer_->model(); }

  // PSNR of the baked patches over held-out photos.
  double bakedPsnr(uint32_t level = 0) {
    const BakedPatches patches =
        bakePatches(model(), level, level == 0 ? model().atlas()->faces : model().coarseAtlas(level)->faces, {});
    const MeshTracer tracer = makeBakedTracer(patches);
    const BakedShading shading(patches);
    const SceneFrame& frame = model().frame();
    double squares = 0, numbers = 0;
    for (const int index : scene_.capture().photosIn(Split::test)) {
      const Photo& photo = scene_.capture().photos[index];
      const Camera& camera = scene_.capture().cameras[photo.camera];
      const RenderedView truth = scene_.truth(camera, photo.worldFromCamera);
      for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
          const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
          const Vec3d direction = (frame.rotation * (photo.worldFromCamera.rotation * *inCamera)).normalized();
          std::vector<MeshHit> hits;
          tracer.addHits(frame.sceneFromWorld(photo.worldFromCamera.translation).cast<float>(), direction.cast<float>(),
                         0.05f, 1e6f, hits);
          CompositedRay ray;
          compositeHits(hits, direction, 1e-4f, shading, ray);
          for (int c = 0; c < 3; ++c, ++numbers) squares += std::pow(ray.colour[c] - truth.colour.at(x, y)[c], 2);
        }
    }
    return -10 * std::log10(squares / numbers);
  }

  static constexpr uint32_t kRays = 600;
  const CubeScene scene_;
  const std::unique_ptr<Device> device_ = makeDevice({"cpu", 2});
  std::unique_ptr<MeshTrainer> trainer_;
};

TEST_F(AtlasStageTest, SeesWhatIsDrawnOfTheBakedPatches) {
  MeshConfig config = smallMeshConfig();
  config.meshLevels = 1;
  config.finalShare = 0.2;
  train(config, 200, 200);
  ASSERT_TRUE(model().atlas());
  ASSERT_GT(model().atlas()->faces.count(), 100u);
  AtlasStage stage(model(), 0, TexelAtlas(model(), 0, model().atlas()->faces, model().atlas()->patchEdge), kRays,
                   1 << 14);
  PhotoRays::Settings settings;
  settings.maxRays = kRays;
  PhotoRays rays(*device_, scene_.capture(), model().frame(), settings);
  rays.draw(7, kRays);
  PhotoLoss loss(*device_, scene_.capture(), config, kRays);
  Array<float> losses = device_->array<float>(AtlasStage::kLosses);
  Array<uint32_t> counters = device_->array<uint32_t>(AtlasStage::kCounters);
  stage.addGradients(rays, rays.count(), loss, losses, counters);
  const std::vector<uint32_t> counts = device_->read(counters.all());
  ASSERT_EQ(counts[1], kRays) << "all rays fit";
  EXPECT_GT(counts[2], counts[0]) << "a hit has up to four texels";

  const BakedPatches patches = bakePatches(model(), 0, model().atlas()->faces, {});
  const MeshTracer tracer = makeBakedTracer(patches);
  const BakedShading shading(patches);
  const std::vector<float> origins = device_->read(rays.origins(0, kRays)),
                           directions = device_->read(rays.directions(0, kRays)),
                           colours = device_->read(stage.colours()), opacities = device_->read(stage.opacities());
  uint32_t different = 0, opaque = 0;
  for (size_t r = 0; r < kRays; ++r) {
    const Vec3f origin(origins[3 * r], origins[3 * r + 1], origins[3 * r + 2]),
        direction(directions[3 * r], directions[3 * r + 1], directions[3 * r + 2]);
    std::vector<MeshHit> hits;
    tracer.addHits(origin, direction, static_cast<float>(config.near), 1e6f, hits);
    CompositedRay ray;
    compositeHits(hits, direction.cast<double>().normalized(), 1e-4f, shading, ray);
    bool isSame = std::abs(1 - ray.transmittance - opacities[r]) < 5e-3;
    for (size_t c = 0; c < 3; ++c) isSame = isSame && std::abs(ray.colour[c] - colours[3 * r + c]) < 5e-3;
    different += isSame ? 0 : 1;
    opaque += opacities[r] > 0.9f ? 1 : 0;
  }
  EXPECT_LE(different, kRays / 100) << "rays through edges may hit one triangle or two";
  EXPECT_GT(opaque, kRays / 20);
}

TEST_F(AtlasStageTest, MakesContentsLookMoreLikeThePhotos) {
  MeshConfig config = smallMeshConfig();
  config.meshLevels = 1;
  config.finalShare = 0.3;
  constexpr int64_t kSteps = 400, kFirst = 280;
  train(config, kSteps, kFirst + 1);  // the atlas is there, and hardly trained
  const double before = bakedPsnr();
  for (int64_t step = kFirst + 1; step < kSteps; ++step) trainer_->step(step, kSteps);
  EXPECT_GT(bakedPsnr(), before + 0.5);
}

TEST_F(AtlasStageTest, FitsCoarseLevelsThatLookAlmostAsTheFinestAndDoNotChangeIt) {
  MeshConfig config = smallMeshConfig();
  config.meshCells = 32;
  config.meshLevels = 2;
  config.finalShare = 0.3;
  constexpr int64_t kSteps = 400, kFirst = 280;
  train(config, kSteps, kFirst);
  EXPECT_EQ(model().levels(), 1u) << "there are no coarse levels before the final stage";
  trainer_->step(kFirst, kSteps);
  ASSERT_EQ(model().levels(), 2u);
  ASSERT_NE(model().coarseAtlas(1), nullptr);
  const size_t finest = model().atlas()->faces.count(), coarse = model().coarseAtlas(1)->faces.count();
  EXPECT_GT(coarse, 50u);
  EXPECT_LT(static_cast<double>(coarse), 0.4 * static_cast<double>(finest));
  const double before = bakedPsnr(1);
  for (int64_t step = kFirst + 1; step < kSteps; ++step) trainer_->step(step, kSteps);
  EXPECT_GT(bakedPsnr(1), before + 0.3) << "its texels are trained";
  EXPECT_GT(bakedPsnr(1), bakedPsnr(0) - 2.5);
  std::map<std::string, Bytes> tensors[2];
  for (auto& ofTraining : tensors) {
    const Bytes checkpoint = trainer_->save(0);
    const std::optional<Safetensors> file = decodeSafetensors(checkpoint);
    ASSERT_TRUE(file);
    for (const auto& [name, tensor] : file->tensors)
      if (!name.starts_with("level1.")) ofTraining[name] = Bytes(tensor.bytes.begin(), tensor.bytes.end());
    config.meshLevels = 1;
    train(config, kSteps, kSteps);
  }
  EXPECT_TRUE(tensors[0] == tensors[1]);
  EXPECT_GT(tensors[0].size(), 10u);
}

}  // namespace
}  // namespace tessera
