#include "representations/mesh/train/mesh_trainer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "representations/field/testing/trained_cube.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/extraction.h"
#include "representations/mesh/train/mesh_renderer.h"

namespace tessera {
namespace {

// The region of interest of the cube as one block.
MeshPart wholeCube(const CubeScene& scene) {
  return {"block_0_0", 0, fitSceneFrame(scene.capture(), 0.5), {1, 1, 1}};
}

// Training that starts everywhere, from all pixels.
MeshStart startEverywhere(const CubeScene& scene, const OctahedraDomain& domain) {
  MeshStart start;
  start.cells.assign(size_t{domain.latticeCells()} * domain.latticeCells() * domain.latticeCells(), true);
  start.tiles.resize(scene.capture().photos.size());
  for (const int photo : scene.capture().photosIn(Split::train))
    start.tiles[photo] = {{{photo, 0, 0, CubeScene::kWidth, CubeScene::kHeight}},
                          {1.0 * CubeScene::kWidth * CubeScene::kHeight}};
  return start;
}

// Training from the pixels of the cube alone: rays beside it are rays through the block.
MeshStart startAtCube(const CubeScene& scene, const OctahedraDomain& domain) {
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

double heldOutPsnr(const CubeScene& scene, MeshModel& model, uint32_t level = 0) {
  MeshPartRenderer renderer(model, level);
  double sum = 0;
  const std::vector<int> photos = scene.capture().photosIn(Split::test);
  for (const int index : photos) {
    const Photo& photo = scene.capture().photos[index];
    const Camera& camera = scene.capture().cameras[photo.camera];
    sum += computePsnr(renderer.render(camera, photo.worldFromCamera, nullptr),
                       scene.truth(camera, photo.worldFromCamera));
  }
  return sum / static_cast<double>(photos.size());
}

TEST(MeshTrainer, LearnsWhatHeldOutPhotosSee) {
  const CubeScene scene;
  CubeTraining trained(scene, smallMeshConfig(), 400);
  EXPECT_GT(heldOutPsnr(scene, trained.trainer->model()), 17);
}

// Returns the networks, the table and the exposures of a checkpoint, and the finest level.
std::map<std::string, Bytes> finestTensors(const Bytes& checkpoint) {
  const auto file = decodeSafetensors(checkpoint);
  std::map<std::string, Bytes> tensors;
  for (const auto& [name, tensor] : file->tensors)
    if (!name.starts_with("level") || name.starts_with("level0."))
      tensors[name] = Bytes(tensor.bytes.begin(), tensor.bytes.end());
  return tensors;
}

TEST(MeshTrainer, TrainsCoarseLevelsThatChangeNothingElse) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig(), alone = config;
  config.meshCells = alone.meshCells = 32;
  config.meshLevels = 3;
  config.fittedLevels = false;
  alone.meshLevels = 1;
  constexpr int64_t kSteps = 400;
  CubeTraining trained(scene, config, kSteps), single(scene, alone, kSteps);
  EXPECT_EQ(finestTensors(trained.trainer->save(0)), finestTensors(single.trainer->save(0)));
  MeshModel& model = trained.trainer->model();
  ASSERT_EQ(model.levels(), 3u);
  for (uint32_t number = 0; number < 3; ++number) {
    MeshLevel& level = model.level(number);
    EXPECT_EQ(level.domain().grids.at(0).resolution, 32u >> number);
    double largest = 0;
    for (const float d : trained.device->read(level.displacements().values.all()))
      largest = std::max(largest, std::abs(double{d}));
    EXPECT_GT(largest, 0.1) << number;
    EXPECT_LE(largest, 0.5) << number;
    EXPECT_GT(heldOutPsnr(scene, model, number), 15) << number;
  }
}

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

TEST(MeshTrainer, StatesHowWellTheBlockCoversWhatPhotosShowInTheEnd) {
  const CubeScene scene;
  constexpr int64_t kSteps = 100;
  CubeTraining trained(scene, smallMeshConfig(), 0, 2, startAtCube);
  MeshModel& model = trained.trainer->model();
  const std::vector<TileShares> tiles = startAtCube(scene, model.level(0).domain()).tiles;
  SurfaceCoverage first;
  for (int64_t step = 0; step < kSteps; ++step) {
    trained.trainer->step(step, kSteps);
    if (model.atlas() && first.pixels == 0) first = model.atlas()->coverage;
  }
  const SurfaceCoverage last = model.atlas()->coverage;
  EXPECT_EQ(last.part, "block_0_0");
  EXPECT_EQ(last, checkCoverage(model, scene.capture(), tiles));
  EXPECT_EQ(last.pixels, first.pixels);
  EXPECT_NE(last.holes, first.holes) << "the final stage changes opacities";
}

TEST(MeshModel, RefusesAnImpossibleCoverage) {
  const MeshPart part{"block_0_0", 0, {}, {1, 1, 1}};
  const auto read = [&](const std::vector<uint32_t>& numbers) {
    TensorSet tensors;
    tensors.add("atlas.coverage", numbers);
    return readCoverage(part, "state", *decodeSafetensors(tensors.encode({})));
  };
  EXPECT_EQ(read({9, 2}), (SurfaceCoverage{"block_0_0", 9, 2}));
  for (const std::vector<uint32_t>& numbers : std::vector<std::vector<uint32_t>>{{9}, {9, 10}, {0, 0}, {9, 2, 1}})
    EXPECT_THROW(read(numbers), Error);
  EXPECT_FALSE(readCoverage(part, "state", *decodeSafetensors(TensorSet().encode({}))));
}

TEST(MeshTrainer, MovesVerticesToTheSurfaceWithinTheirCells) {
  const CubeScene scene;
  MeshConfig moving = smallMeshConfig();
  moving.finalShare = 0;
  MeshConfig still = moving;
  still.vertexLearningRate = 0;
  CubeTraining moved(scene, moving, 400), unmoved(scene, still, 400);
  EXPECT_GT(heldOutPsnr(scene, moved.trainer->model()), heldOutPsnr(scene, unmoved.trainer->model()));
  double largest = 0;
  for (const float d : moved.device->read(moved.trainer->model().level(0).displacements().values.all()))
    largest = std::max(largest, std::abs(double{d}));
  EXPECT_GT(largest, 0.1);
  EXPECT_LE(largest, 0.5);
  for (const float d : unmoved.device->read(unmoved.trainer->model().level(0).displacements().values.all()))
    ASSERT_EQ(d, 0);
}

// Returns the mean opacity of the pixels of held-out photos that show nothing.
double opacityBesideCube(const CubeScene& scene, MeshModel& model) {
  MeshPartRenderer renderer(model, 0);
  double sum = 0;
  int pixels = 0;
  for (const int index : scene.capture().photosIn(Split::test)) {
    const Photo& photo = scene.capture().photos[index];
    const Camera& camera = scene.capture().cameras[photo.camera];
    const RenderedView view = renderer.render(camera, photo.worldFromCamera, nullptr),
                       truth = scene.truth(camera, photo.worldFromCamera);
    for (size_t pixel = 0; pixel < truth.opacity.pixels.size(); ++pixel) {
      if (truth.opacity.pixels[pixel] > 0) continue;
      sum += view.opacity.pixels[pixel];
      ++pixels;
    }
  }
  return sum / pixels;
}

TEST(MeshTrainer, EmptiesTheSpaceThatRaysThroughTheBlockCross) {
  const CubeScene scene;
  MeshConfig with = smallMeshConfig();
  with.opacityOffset = -2;             // fog at the start
  with.occupancyStartSteps = 1 << 20;  // which remains where no ray comes
  with.finalShare = 0;
  with.throughShare = 0.25;
  MeshConfig without = with;
  without.throughShare = 0;
  constexpr int64_t kSteps = 150;
  CubeTraining cleared(scene, with, kSteps, 2, startAtCube), foggy(scene, without, kSteps, 2, startAtCube);
  const double left = opacityBesideCube(scene, cleared.trainer->model()),
               fog = opacityBesideCube(scene, foggy.trainer->model());
  EXPECT_GT(fog, 0.4);
  EXPECT_LT(left, 0.2 * fog);
  EXPECT_LT(cleared.last.rays, foggy.last.rays) << "their hits count as those of other rays";
}

TEST(MeshTrainer, MakesTheSameBytesOnAnyNumberOfThreads) {
  const CubeScene scene;
  for (const MakeStart start : {startEverywhere, startAtCube}) {
    const auto train = [&](int threads) {
      return CubeTraining(scene, smallMeshConfig(), 90, threads, start).trainer->save(0);
    };
    const Bytes one = train(1);
    EXPECT_EQ(one, train(2));
    EXPECT_EQ(one, train(5));
  }
}

TEST(MeshTrainer, GoesOnAfterRestoringAsIfNothingHadHappened) {
  const CubeScene scene;
  constexpr int64_t kSteps = 90;
  for (const MakeStart start : {startEverywhere, startAtCube}) {
    CubeTraining unbroken(scene, smallMeshConfig(), kSteps, 2, start);
    Bytes state;
    int64_t step = 0;
    for (const int64_t until : {0, 1, 15, 17, 64, 65, 72, 90}) {
      CubeTraining part(scene, smallMeshConfig(), 0, 2, start);
      if (!state.empty()) {
        const auto file = decodeSafetensors(state);
        ASSERT_TRUE(file);
        part.trainer->restore(0, "state", *file);
      }
      for (; step < until; ++step) part.trainer->step(step, kSteps);
      state = part.trainer->save(0);
    }
    EXPECT_EQ(state, unbroken.trainer->save(0));
    EXPECT_NE(unbroken.trainer->model().coarseAtlas(1), nullptr) << "levels were fitted and stored, too";
  }
}

TEST(SurfaceSurvey, FindsTheCellsAndPixelsOfSurfacesInABlock) {
  const CubeScene scene;
  TrainedCube coarse(scene, cubeConfig(), 300);
  const SurfaceSurvey survey(scene.capture(), coarse.trainer->model(), true);
  const MeshPart block{"block_0_0", 0, coarse.frame, {1, 1, 1}};
  const OctahedraDomain domain = makeOctahedraDomain(block, 32, OctahedraPlacement::checkerboard);
  const MeshStart start = survey.findStart(block, domain);
  // Every point of the cube's surface lies in such a cell; few other cells are marked.
  size_t marked = 0;
  for (const bool cell : start.cells) marked += cell;
  EXPECT_LT(marked, start.cells.size() / 2);
  int missing = 0, all = 0;
  for (const double u : {-0.45, -0.2, 0.0, 0.25, 0.45})
    for (const double v : {-0.4, -0.1, 0.15, 0.4})
      for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-0.5, 0.5}) {
          Vec3d at;
          at[axis] = side;
          at[(axis + 1) % 3] = u;
          at[(axis + 2) % 3] = v;
          const auto cell = domain.latticeCell(block.frame.sceneFromWorld(CubeScene::centre() + at));
          ASSERT_TRUE(cell);
          ++all;
          missing += !start.cells[*cell];
        }
  EXPECT_LE(missing, all / 20);
  // In cells that photos see, vertices start near the cube's surface, not in the middle of their cells. Those at its
  // edges, where the mean of its points is within it, are left out.
  const OctahedraDomain wide = makeOctahedraDomain(block, 20, OctahedraPlacement::checkerboard);
  const std::vector<float> displacements = survey.findDisplacements(block, wide);
  double fromSurface = 0, fromMiddle = 0;
  size_t moved = 0;
  const OctahedraGrid& grid = wide.grids[0];
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) {
    const float* const d = &displacements[size_t{3} * cell];
    if (d[0] == 0 && d[1] == 0 && d[2] == 0) continue;
    Vec3d middle, vertex;  // from the centre of the cube
    for (uint32_t axis = 0, rest = cell; axis < 3; ++axis, rest /= grid.resolution) {
      const double unit = grid.gridFromScene[5 * axis], half = grid.gridFromScene[4 * axis + 3],
                   at = rest % grid.resolution + 0.5;
      middle[axis] = (at - half) / unit;
      vertex[axis] = (at + d[axis] - half) / unit;
    }
    middle = block.frame.worldFromScene(middle) - CubeScene::centre();
    vertex = block.frame.worldFromScene(vertex) - CubeScene::centre();
    int axis = 0;
    middle.cwiseAbs().maxCoeff(&axis);
    if (std::max(std::abs(middle[(axis + 1) % 3]), std::abs(middle[(axis + 2) % 3])) > 0.3) continue;
    fromMiddle += std::abs(std::abs(middle[axis]) - 0.5);
    fromSurface += std::abs(std::abs(vertex[axis]) - 0.5);
    ++moved;
  }
  EXPECT_GT(moved, 20u);
  EXPECT_LT(fromSurface, 0.7 * fromMiddle) << moved << " vertices";
  // Photos are transparent around the cube, so only the tiles on it are used.
  for (const int photo : scene.capture().photosIn(Split::train)) {
    const double share = start.tiles[photo].total() / (CubeScene::kWidth * CubeScene::kHeight);
    EXPECT_GT(share, 0.1) << photo;
    EXPECT_LT(share, 1) << photo;
  }
  for (const int photo : scene.capture().photosIn(Split::test)) EXPECT_TRUE(start.tiles[photo].tiles.empty());
  // Nothing but the sky is outside of a region around the cube: those pixels that show no surface.
  const MeshPart outside{"background", -1, coarse.frame, {1, 1, 1}};
  const MeshStart sky = survey.findStart(outside, makeOctahedraDomain(outside, 16, OctahedraPlacement::checkerboard));
  for (const int photo : scene.capture().photosIn(Split::train))
    EXPECT_NEAR(start.tiles[photo].total() + sky.tiles[photo].total(), CubeScene::kWidth * CubeScene::kHeight, 1);
  // A block beside the cube has nothing to show.
  MeshPart beside = block;
  beside.frame.centre += beside.frame.worldFromScene({3, 0, 0}) - beside.frame.worldFromScene({0, 0, 0});
  EXPECT_EQ(survey.findStart(beside, makeOctahedraDomain(beside, 32, OctahedraPlacement::checkerboard)).pixels(), 0);
}

TEST(SurfaceSurvey, FindsTheTilesThatShowOnlyWhatIsBehindABlock) {
  const CubeScene scene;
  TrainedCube coarse(scene, cubeConfig(), 300);
  const SurfaceSurvey survey(scene.capture(), coarse.trainer->model(), false);
  // A small block beside the cube, which is in front of it or behind it.
  constexpr double kHalf = 0.2;
  MeshPart block{"block_0_0", 0, {}, {1, 1, 1}};
  block.frame.centre = CubeScene::centre() + Vec3d(1, 0, 0);
  block.frame.scale = 1 / kHalf;
  const TileShares through = survey.findStart(block, makeOctahedraDomain(block, 16, {})).through;
  int onCube = 0, onSky = 0;
  for (const PhotoTile& tile : through.tiles) {
    const Photo& photo = scene.capture().photos[tile.photo];
    ASSERT_EQ(photo.split, Split::train);
    const Camera& camera = scene.capture().cameras[photo.camera];
    const RenderedView truth = scene.truth(camera, photo.worldFromCamera);
    const Vec2d middle = {0.5 * (tile.left + tile.right), 0.5 * (tile.top + tile.bottom)};
    const Vec3d eye = block.frame.sceneFromWorld(photo.worldFromCamera.translation),
                towards = photo.worldFromCamera.rotation * *camera.directionInCamera(middle);
    double leave = 1e9;
    for (int axis = 0; axis < 3; ++axis)
      leave = std::min(leave, (std::copysign(1, towards[axis]) - eye[axis]) / towards[axis]);
    EXPECT_GT(eye.z() + leave * towards.z(), -1) << photo.name << ": below the block";
    for (int y = static_cast<int>(tile.top); y < static_cast<int>(tile.bottom); ++y)
      for (int x = static_cast<int>(tile.left); x < static_cast<int>(tile.right); ++x) {
        const float opacity = *truth.opacity.at(x, y);
        ++(opacity > 0 ? onCube : onSky);
        if (opacity == 0) continue;
        const Vec3d inCamera = *camera.directionInCamera({x + 0.5, y + 0.5});
        const Vec3d at = photo.worldFromCamera.translation +
                         photo.worldFromCamera.rotation * inCamera / inCamera.z() * (*truth.depth.at(x, y) / opacity);
        EXPECT_LT(at.x(), block.frame.centre.x() - kHalf) << photo.name;
        EXPECT_GT(photo.worldFromCamera.translation.x(), block.frame.centre.x() - kHalf) << photo.name;
      }
  }
  EXPECT_GT(onCube, 100);
  EXPECT_GT(onSky, 100);
  EXPECT_EQ(through.total(), onCube + onSky);
  const MeshPart outside{"background", -1, coarse.frame, {1, 1, 1}};
  EXPECT_TRUE(survey.findStart(outside, makeOctahedraDomain(outside, 16, {})).through.tiles.empty());
}

TEST(MeshModel, HasOnlyQuadsIfRequested) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.quads = true;
  MeshModel model(*device, config, {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  // The vertices are in the middles of cells, so a ray straight down meets one quad in each layer of cells.
  const Array<float> origins = device->uploadArray(std::vector<float>{0.07f, 0.05f, 3}),
                     directions = device->uploadArray(std::vector<float>{0, 0, -1});
  const uint32_t layers = static_cast<uint32_t>(config.meshCells);
  MeshHits hits(*device, 1, 4 * layers);
  Array<uint32_t> counters = device->array<uint32_t>(MeshHits::kCounters);
  hits.counters = counters;
  const auto trace = [&] {
    level.trace({1, origins, directions, {}}, 4 * layers, false, hits);
    return device->read(counters.all())[0];
  };
  ASSERT_EQ(trace(), layers);
  const FaceSet quads = FaceSet::quads(level.domain().grids);
  for (const uint32_t face : device->read(hits.faces.part(0, layers))) EXPECT_TRUE(quads.contains(face));
  FaceSet one(level.domain().grids);
  one.add(device->read(hits.faces.part(0, 1))[0]);
  level.limitToFaces(one);
  EXPECT_EQ(trace(), 1u);
  level.removeLimit();
  EXPECT_EQ(trace(), layers) << "not the other faces of octahedra";
}

TEST(MeshModel, EmptiesTheCellsThatNoRayReaches) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.opacityOffset = 0;
  config.everyCell = true;
  MeshModel model(*device, config, {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  level.exclude(std::vector<bool>(level.domain().grids[0].cells(), true));
  // One ray straight down through the middle of a column of cells, whose first hit is opaque and the second is not.
  const Array<float> origins = device->uploadArray(std::vector<float>{0.07f, 0.05f, 3}),
                     directions = device->uploadArray(std::vector<float>{0, 0, -1});
  const MeshRays rays{1, origins, directions, {}};
  constexpr uint32_t kMaxHits = 200;
  MeshHits hits(*device, 1, kMaxHits);
  Array<uint32_t> counters = device->array<uint32_t>(MeshHits::kCounters);
  hits.counters = counters;
  std::vector<float> logits(kMaxHits, 5);
  logits[0] = 0;  // half opaque; the second hit leaves a transmittance below a hundredth
  const Array<float> opacities = device->uploadArray(logits);
  level.trace(rays, kMaxHits, false, hits);
  const uint32_t all = device->read(counters.all())[0];
  ASSERT_GT(all, 20u);
  const std::vector<float> positions = device->read(hits.positions.part(0, size_t{3} * all));
  for (int update = 0; update < 40; ++update) {
    level.addOccupancy(rays, hits, Matrix<const float>(opacities.all(), 1));
    level.refreshOccupancy(true);
  }
  std::vector<uint32_t> expected(level.domain().grids[0].words());
  for (const uint32_t reached : {0u, 1u}) {
    uint32_t cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const uint32_t n = static_cast<uint32_t>(config.meshCells);
      cell = cell * n + static_cast<uint32_t>(positions[3 * size_t{reached} + axis] * static_cast<float>(n));
    }
    expected[cell / 32] |= 1u << cell % 32;
  }
  EXPECT_EQ(level.occupancy().bitWords(), expected);
  level.trace(rays, kMaxHits, false, hits);
  EXPECT_LT(device->read(counters.all())[0], all / 2) << "hits beyond the surface and its neighbours";
}

TEST(MeshModel, DilatesCellsByOneInAllDirections) {
  constexpr uint32_t kCells = 6;
  std::vector<uint32_t> bits((kCells * kCells * kCells + 31) / 32);
  const auto index = [](uint32_t x, uint32_t y, uint32_t z) { return x + kCells * (y + kCells * z); };
  for (const uint32_t cell : {index(2, 3, 3), index(5, 0, 0)}) bits[cell / 32] |= 1u << cell % 32;
  const std::vector<uint32_t> dilated = dilateCells(bits, kCells);
  for (uint32_t z = 0; z < kCells; ++z)
    for (uint32_t y = 0; y < kCells; ++y)
      for (uint32_t x = 0; x < kCells; ++x) {
        const bool beside = (x >= 1 && x <= 3 && y >= 2 && y <= 4 && z >= 2 && z <= 4) || (x >= 4 && y <= 1 && z <= 1);
        EXPECT_EQ(dilated[index(x, y, z) / 32] >> index(x, y, z) % 32 & 1, beside) << x << " " << y << " " << z;
      }
}

}  // namespace
}  // namespace tessera
