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
MeshContent square() {
  MeshContent content;
  content.patchEdge = 5;
  content.pairs = 1;
  content.vertices = {0, 0, 0, 4, 0, 0, 0, 4, 0, 4, 4, 0};
  for (uint32_t row = 0; row < 5; ++row)
    for (uint32_t column = 0; column < 5; ++column) {
      for (uint32_t f = 0; f < kMeshFeatures; ++f) content.texels.push_back(static_cast<uint8_t>(10 * column + f));
      content.texels.push_back(static_cast<uint8_t>(50 * column));
    }
  for (uint32_t f = 0; f < kMeshFeatures; ++f) content.ranges[f] = {-1, 1.55f};
  DenseLayer layer;
  layer.inputs = kMeshFeatures + kMeshHarmonics;
  layer.outputs = 3;
  layer.weights.resize(size_t{layer.inputs} * 3);
  for (int c = 0; c < 3; ++c) layer.weights[size_t{layer.inputs} * c + c] = 1;
  content.decoder = {layer};
  return content;
}

TEST(MeshTracer, FindsAllHitsWithTheirTexelsAndCompositesThem) {
  MeshContent content = square();
  // A second square above the first.
  const MeshContent above = square();
  content.vertices.insert(content.vertices.end(), above.vertices.begin(), above.vertices.end());
  for (int corner = 4; corner < 8; ++corner) content.vertices[3 * corner + 2] = 1;
  content.texels.insert(content.texels.end(), above.texels.begin(), above.texels.end());
  content.pairs = 2;
  const MeshTracer tracer(content);
  for (const auto& [x, y] : std::vector<std::pair<float, float>>{{1.25f, 0.5f}, {3.25f, 3.0f}, {0.1f, 3.7f}}) {
    std::vector<MeshTracer::Hit> hits;
    tracer.addHits({x, y, 3}, {0, 0, -2}, 0, 100, hits);
    ASSERT_EQ(hits.size(), 2u) << x;
    for (const MeshTracer::Hit& hit : hits) {
      EXPECT_NEAR(hit.column, x, 1e-5);
      EXPECT_NEAR(hit.row, y, 1e-5);
      EXPECT_NEAR(hit.distance, hit.patch == 0 ? 1.5 : 1, 1e-6);
    }
    const float opacity = 50 * x / 255, feature = -1 + 2.55f * 10 * x / 255;
    const CompositedRay ray = compositeHits(hits, {0, 0, -2}, 0);
    EXPECT_NEAR(ray.opacity, 1 - (1 - opacity) * (1 - opacity), 1e-5);
    EXPECT_NEAR(ray.colour[0], ray.opacity / (1 + std::exp(-feature)), 1e-4);
    EXPECT_NEAR(ray.depth, opacity * 1 + (1 - opacity) * opacity * 1.5, 1e-5);
  }
  std::vector<MeshTracer::Hit> hits;
  tracer.addHits({1, 1, 3}, {0, 0, -2}, 1.2f, 100, hits);
  EXPECT_EQ(hits.size(), 1u) << "near";
  tracer.addHits({5, 1, 3}, {0, 0, -2}, 0, 100, hits);
  EXPECT_EQ(hits.size(), 1u) << "beside";
}

TEST(MeshContent, ChangesLittleByBlockCompression) {
  MeshContent content = square();
  content.patchEdge = 4;
  content.texels.clear();
  for (uint32_t i = 0; i < 16; ++i)
    for (uint32_t number = 0; number < kMeshNumbers; ++number)
      content.texels.push_back(static_cast<uint8_t>(40 + 7 * (i % 4) + 3 * (i / 4) + 10 * number));
  const std::vector<uint8_t> before = content.texels;
  passThroughBc4(content, Bc4Effort::fast);
  EXPECT_NE(content.texels, before);
  for (size_t i = 0; i < before.size(); ++i)
    EXPECT_LE(std::abs(content.texels[i] - before[i]), 30 / 14 + 1) << "a fourteenth of each number's own range";
}

// The content of a trained cube looks as its model does.
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
  const FaceSet faces = extractFaces(model, 0, scene.capture(), extraction);
  MeshBakeSettings settings;
  settings.patchEdge = 16;
  settings.opaqueFrom = 2;  // as trained
  settings.transparentBelow = 0;
  const MeshContent content = bakeMeshContent(model, 0, faces, settings);
  EXPECT_LE(content.triangles(), faces.count());
  EXPECT_GT(content.triangles(), faces.count() / 2) << "those within the block";
  EXPECT_GT(content.pairs, content.triangles() / 4);

  model.level(0).keepFaces(faces.bits());
  MeshPartRenderer renderer(model);
  const MeshTracer tracer(content);
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
        std::vector<MeshTracer::Hit> hits;
        tracer.addHits(origin, direction, static_cast<float>(config.near), 1e6f, hits);
        const CompositedRay ray = compositeHits(hits, direction, 0);
        for (int c = 0; c < 3; ++c) {
          const double difference = ray.colour[c] - view.colour.at(x, y)[c];
          squares += difference * difference;
          ++numbers;
        }
      }
  }
  EXPECT_GT(-10 * std::log10(squares / static_cast<double>(numbers)), 28);
}

}  // namespace
}  // namespace tessera
