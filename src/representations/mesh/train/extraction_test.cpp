#include "representations/mesh/train/extraction.h"

#include <gtest/gtest.h>

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
