#include "representations/mesh/train/mesh_start.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "representations/mesh/testing/cube_training.h"
#include "representations/mesh/train/coarse_view.h"

namespace tessera {
namespace {

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

TEST(SurfaceSurvey, FindsTheCellsOutsideOfAFlatRegion) {
  const CubeScene scene;
  TrainedCube coarse(scene, cubeConfig(), 300);
  const SurfaceSurvey survey(scene.capture(), coarse.trainer->model(), false);
  // The cells around it are eight times as wide as they are high.
  MeshPart outside{"background", -1, {}, {1, 1, 0.125f}};
  outside.frame.centre = CubeScene::centre();
  outside.frame.scale = 1 / 0.4;
  const OctahedraDomain domain = makeOctahedraDomain(outside, 32, OctahedraPlacement::checkerboard);
  const MeshStart start = survey.findStart(outside, domain);
  int missing = 0, all = 0;
  for (double u = -0.48; u < 0.5; u += 0.07)
    for (double z = -0.04; z < 0.3; z += 0.004)
      for (int axis = 0; axis < 2; ++axis)
        for (const double side : {-0.5, 0.5}) {
          Vec3d at;
          at[axis] = side;
          at[1 - axis] = u;
          at[2] = z;
          const auto cell = domain.latticeCell(outside.frame.sceneFromWorld(CubeScene::centre() + at));
          if (!cell) continue;
          ++all;
          missing += !start.cells[*cell];
        }
  EXPECT_GT(all, 1000);
  EXPECT_LE(missing, all / 20);
  EXPECT_LT(std::count(start.cells.begin(), start.cells.end(), true), static_cast<ptrdiff_t>(start.cells.size() / 2));
}

TEST(SurfaceSurvey, SeesSurfacesBehindTheCamera) {
  CubeScene::Options enclosed;
  enclosed.isEnclosed = true;
  const CubeScene scene(enclosed);
  TrainedCube coarse(scene, cubeConfig(), 100);
  FieldRenderer renderer(coarse.trainer->model());
  Camera camera;
  camera.width = camera.height = 24;
  camera.lens = LensModel::openCvFisheye;
  camera.parameters = {5, 5, 12, 12};
  const Pose& pose = scene.capture().photos[0].worldFromCamera;
  const CoarseView view(renderer, camera, pose);
  int behind = 0;
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
      const auto surface = view.surfaceAt(x, y, 0.5f);
      if (!inCamera || inCamera->z() > -0.05 || !surface) continue;
      ++behind;
      const Vec3d towards = pose.rotation * *inCamera;
      EXPECT_GT((surface->at - pose.translation).dot(towards), 0);
      EXPECT_LT(surface->depth, 0);
    }
  EXPECT_GT(behind, 10);
}

TEST(SurfaceSurvey, LooksAtFewerTilesOfEachPhotoTheMorePhotosThereAre) {
  const CubeScene scene;
  EXPECT_EQ(tileEdge(scene.capture()), kLeastTileEdge);
  Capture large;
  large.cameras.push_back(scene.capture().cameras[0].scaledTo(4000, 3000));
  large.photos.resize(1000);
  const double edge = tileEdge(large);
  EXPECT_GT(edge, 70);
  EXPECT_LT(edge, 80);
  EXPECT_LE(1000 * (4000 / edge) * (3000 / edge), kMaxTiles);
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

}  // namespace
}  // namespace tessera
