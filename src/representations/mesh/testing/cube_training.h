// Trainings of one block on photos of a cube, for tests.
#pragma once

#include "representations/field/testing/trained_cube.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/mesh_renderer.h"
#include "representations/mesh/train/mesh_trainer.h"

namespace tessera {

// The region of interest of the cube as one block.
inline MeshPart wholeCube(const CubeScene& scene) {
  return {"block_0_0", 0, fitSceneFrame(scene.capture(), 0.5), {1, 1, 1}};
}

// Training that starts everywhere, from all pixels.
inline MeshStart startEverywhere(const CubeScene& scene, const OctahedraDomain& domain) {
  MeshStart start;
  start.cells.assign(size_t{domain.latticeCells()} * domain.latticeCells() * domain.latticeCells(), true);
  start.tiles.resize(scene.capture().photos.size());
  for (const int photo : scene.capture().photosIn(Split::train))
    start.tiles[photo] = {{{photo, 0, 0, CubeScene::kWidth, CubeScene::kHeight}},
                          {1.0 * CubeScene::kWidth * CubeScene::kHeight}};
  return start;
}

// Training from the pixels of the cube alone: rays beside it are rays through the block.
inline MeshStart startAtCube(const CubeScene& scene, const OctahedraDomain& domain) {
  constexpr uint32_t kEdge = 4;
  MeshStart start = startEverywhere(scene, domain);
  for (const int index : scene.capture().photosIn(Split::train)) {
    start.tiles[index] = {};
    const Photo& photo = scene.capture().photos[index];
    const RenderedView truth = scene.truth(scene.capture().cameras[photo.camera], photo.worldFromCamera);
    for (uint32_t top = 0; top < CubeScene::kHeight; top += kEdge)
      for (uint32_t left = 0; left < CubeScene::kWidth; left += kEdge) {
        float sum = 0;
        for (uint32_t pixel = 0; pixel < kEdge * kEdge; ++pixel)
          sum += *truth.opacity.at(static_cast<int>(left + pixel % kEdge), static_cast<int>(top + pixel / kEdge));
        TileShares& shares = sum > 0 ? start.tiles[index] : start.through;
        shares.tiles.push_back({index, left, top, left + kEdge, top + kEdge});
        shares.until.push_back(shares.total() + kEdge * kEdge);
      }
  }
  return start;
}

using MakeStart = MeshStart (*)(const CubeScene&, const OctahedraDomain&);

// A training of the cube as one block, after some steps.
struct CubeTraining {
  std::unique_ptr<Device> device;
  std::unique_ptr<MeshTrainer> trainer;
  StepReport last;

  CubeTraining(const CubeScene& scene, const MeshConfig& config, int64_t steps, int threads = 2,
               MakeStart makeStart = startEverywhere)
      : device(makeDevice({"cpu", threads})),
        trainer(std::make_unique<MeshTrainer>(*device, scene.capture(), config, wholeCube(scene),
                                              makeStart(scene, config.domain(wholeCube(scene), 0)))) {
    for (int64_t step = 0; step < steps; ++step) last = trainer->step(step, steps);
  }
};

// Returns the mean PSNR of a level of the block alone in the held-out photos.
inline double heldOutPsnr(const CubeScene& scene, MeshModel& model, uint32_t level = 0) {
  MeshPartRenderer renderer(model, level);
  return heldOutPsnr(scene, renderer);
}

}  // namespace tessera
