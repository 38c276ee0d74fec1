#include <gtest/gtest.h>

#include <algorithm>

#include "representations/volume/cpu/volume_drawer.h"
#include "representations/volume/testing/test_volume_content.h"
#include "scene/block_grid.h"

namespace tessera {
namespace {

constexpr double kVoxel = 2.0 / 64;
// Voxels whose centres lie below this height are solid. The visible surface is where density has grown enough: 0.7 of
// the way from the first empty centre to the last solid one.
constexpr double kGround = -0.5, kGroundSeen = -0.5 + 0.5 * kVoxel - 0.7 * kVoxel;
const Vec3d kHouseLow(-1.25, -0.5, -1), kHouseHigh(-0.5, 0.25, 0.25);  // multiples of a voxel

bool inHouse(const Vec3d& x, double margin = 0) {
  return ((x - kHouseLow).array() > -margin).all() && ((kHouseHigh - x).array() > -margin).all();
}

// A house on a chequered ground, which is blue outside the blocks.
Vec3d colourAt(const Vec3d& x) {
  if (inHouse(x, 0.02)) return {0.9, 0.1, 0.1};
  if (std::abs(x.x()) > 2 || std::abs(x.y()) > 1) return {0.1, 0.2, 0.8};
  const int square = static_cast<int>(std::floor(x.x() / 0.5)) + static_cast<int>(std::floor(x.y() / 0.5));
  return square & 1 ? Vec3d(0.8, 0.8, 0.7) : Vec3d(0.2, 0.5, 0.2);
}

bool isSolid(const Vec3d& x) {
  return x.z() < kGround || inHouse(x);
}

struct Village {
  std::vector<VolumeContent> blocks;  // two, side by side along x
  VolumeContent backgroundBlock;
  TileFrame frame;

  Village() {
    frame.low = Vec3d(-2, -1, -1);
    frame.high = Vec3d(2, 1, 1);
    for (const float x : {-1.0f, 1.0f}) {
      VolumePart part;
      placeCell(part, x, 0);
      part.voxels = 64;
      part.planes = 256;
      makeSolid(part, isSolid, colourAt);
      blocks.push_back(makeVolumeContent({part}));
    }
    VolumePart around;
    around.contracted = around.backgroundBlock = true;
    around.scale = {2, 1, 1};
    around.voxels = 64;
    around.planes = 256;
    makeSolid(
        around, [](const Vec3d& x) { return x.z() < kGround; }, [](const Vec3d&) { return Vec3d(0.1, 0.2, 0.8); });
    backgroundBlock = makeVolumeContent({around});
  }

  SceneDrawing<VolumeContent> drawing(bool withBackgroundBlock = true) const {
    return {frame, {&blocks[0], &blocks[1]}, withBackgroundBlock ? &backgroundBlock : nullptr, {}};
  }
};

const Village& village() {
  static const Village instance;
  return instance;
}

Camera camera() {
  Camera camera;
  camera.width = 240;
  camera.height = 180;
  camera.parameters = {130, 130, 120, 90};
  return camera;
}

// Returns a pose that looks at the scene from the side of the first block.
Pose pose(const Vec3d& eye = Vec3d(-3.2, -2.4, 1.6), const Vec3d& target = Vec3d(-0.3, 0, -0.5)) {
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.translation = eye;
  return pose;
}

RenderedView drawn(const SceneDrawing<VolumeContent>& drawing, const ImageF* opaque = nullptr, int threads = 1,
                   MarchCounts* counts = nullptr) {
  ThreadPool pool(threads);
  return drawScene(drawing, camera(), pose(), opaque, pool, counts);
}

double largestDifference(const ImageF& a, const ImageF& b) {
  double largest = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) largest = std::max<double>(largest, std::abs(a.pixels[i] - b.pixels[i]));
  return largest;
}

// What a ray hits, computed geometrically.
struct Hit {
  double t = INFINITY;
  Vec3d x = Vec3d::Zero(), colour = Vec3d::Zero();
};

Hit hit(const SceneRay& ray) {
  Hit best;
  if (ray.direction.z() < 0) best.t = (kGroundSeen - ray.origin.z()) / ray.direction.z();
  const double inside = 0.2 * kVoxel;
  const Vec3d inset = Vec3d::Constant(inside);
  const RayRange house = clipToBox(ray, kHouseLow + inset, kHouseHigh - inset, {0, 1e6});
  if (!house.empty()) best.t = std::min(best.t, house.near);
  best.x = ray.origin + best.t * ray.direction;
  best.colour = colourAt(best.x);
  return best;
}

TEST(DrawVolume, DrawsAHouseOnTheGroundAsGeometrySays) {
  const RenderedView view = drawn(village().drawing());
  const Pose worldFromCamera = pose();
  int compared = 0, blue = 0, red = 0;
  for (int y = 0; y < camera().height; ++y) {
    for (int x = 0; x < camera().width; ++x) {
      const auto rayAt = [&](double dx, double dy) {
        const Vec3d d = *camera().directionInCamera(Vec2d(x + 0.5 + dx, y + 0.5 + dy));
        return SceneRay{worldFromCamera.translation, worldFromCamera.rotation * d};
      };
      const Hit here = hit(rayAt(0, 0));
      // Edges are blurred by a voxel, so only pixels whose neighbourhood is uniform are compared.
      bool plain = here.t < 20;
      // The surroundings are not visible in front of the box.
      const RayRange box = clipToBox(rayAt(0, 0), village().frame.low, village().frame.high, {0, 1e6});
      plain &= box.empty() || here.t > box.near;
      for (const auto& [dx, dy] :
           {std::pair(-5.0, 0.0), std::pair(5.0, 0.0), std::pair(0.0, -5.0), std::pair(0.0, 5.0)}) {
        const Hit beside = hit(rayAt(dx, dy));
        plain &= beside.colour == here.colour && std::abs(beside.t - here.t) < 0.1 * here.t;
      }
      if (!plain) continue;
      const bool around = std::abs(here.x.x()) > 2 || std::abs(here.x.y()) > 1;
      EXPECT_GT(*view.opacity.at(x, y), 0.99) << x << "," << y;
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(view.colour.at(x, y)[c], here.colour[c], 0.04) << x << "," << y;
      const double cosine = camera().directionInCamera(Vec2d(x + 0.5, y + 0.5))->z();
      // Outside the box voxels are twice as high, and grow with distance.
      const double growth = std::max({1.0, std::abs(here.x.x()) / 2, std::abs(here.x.y())});
      const double height = around ? 2 * kVoxel * growth : 0.7 * kVoxel;
      const double largest = kVoxel + 1.5 * height * here.t / std::max(0.5, pose().translation.z() - here.x.z());
      EXPECT_NEAR(*view.depth.at(x, y), here.t * cosine, largest) << x << "," << y;
      ++compared;
      blue += around;
      red += inHouse(here.x, 0.02);
    }
  }
  EXPECT_GT(compared, 8000);
  EXPECT_GT(blue, 1500);
  EXPECT_GT(red, 500);
  EXPECT_EQ(*view.opacity.at(120, 0), 0);  // the sky
}

TEST(DrawVolume, DrawsTheSameWithAndWithoutSkippingInFarFewerSteps) {
  SceneDrawing<VolumeContent> drawing = village().drawing();
  MarchCounts few, all;
  const RenderedView a = drawn(drawing, nullptr, 1, &few);
  drawing.march.skipEmptySpace = false;
  const RenderedView b = drawn(drawing, nullptr, 1, &all);
  EXPECT_EQ(a.colour.pixels, b.colour.pixels);
  EXPECT_EQ(a.depth.pixels, b.depth.pixels);
  EXPECT_EQ(few.samples, all.samples);
  EXPECT_GT(all.steps, 5 * few.steps);
}

TEST(DrawVolume, DoesNotDependOnTheNumberOfThreads) {
  const RenderedView one = drawn(village().drawing()), three = drawn(village().drawing(), nullptr, 3);
  EXPECT_EQ(one.colour.pixels, three.colour.pixels);
  EXPECT_EQ(one.opacity.pixels, three.opacity.pixels);
  EXPECT_EQ(one.depth.pixels, three.depth.pixels);
}

TEST(DrawVolume, PlacesTheSceneInTheWorldAsTheFrameSays) {
  SceneDrawing<VolumeContent> drawing = village().drawing();
  const RenderedView plain = drawn(drawing);
  drawing.frame.rotation = (Eigen::AngleAxisd(1.1, Vec3d::UnitZ()) * Eigen::AngleAxisd(0.2, Vec3d::UnitX())).matrix();
  drawing.frame.scale = 40;
  drawing.frame.translation = Vec3d(300, -20, 7);
  const Pose inWorld{drawing.frame.rotation * pose().rotation,
                     40 * (drawing.frame.rotation * pose().translation) + drawing.frame.translation};
  ThreadPool pool(1);
  const RenderedView moved = drawScene(drawing, camera(), inWorld, nullptr, pool);
  int different = 0;
  for (size_t i = 0; i < plain.opacity.pixels.size(); ++i) {
    different += std::abs(moved.colour.pixels[3 * i] - plain.colour.pixels[3 * i]) > 1e-3;
    different += std::abs(moved.depth.pixels[i] - 40 * plain.depth.pixels[i]) > 1e-3 * (1 + moved.depth.pixels[i]);
  }
  EXPECT_LT(different, 200);  // rounding moves samples at the border of a cell across it
}

TEST(DrawVolume, DrawsPartsOfOneContentAsItDrawsThemApartWhereNetworksAreDark) {
  const Village& scene = village();
  const VolumeContent merged = makeVolumeContent({scene.blocks[1].parts[0], scene.blocks[0].parts[0]});  // in any order
  SceneDrawing<VolumeContent> drawing = scene.drawing();
  drawing.march.minTransmittance = 0;
  const RenderedView apart = drawn(drawing);
  drawing.frontToBack = {&merged};
  const RenderedView together = drawn(drawing);
  EXPECT_LT(largestDifference(apart.colour, together.colour), 1e-5);
  EXPECT_LT(largestDifference(apart.opacity, together.opacity), 1e-5);
  EXPECT_LT(largestDifference(apart.depth, together.depth), 1e-4);
}

// City-on-Web, equations 8 to 11, along random rays from anywhere: cells in the order of the grid (scene/block_grid.h),
// each shaded by a network that adds nothing, against all samples of the ray composited as one volume.
TEST(DrawVolume, BlendsCellsWithoutNetworksLikeOneVolume) {
  BlockGrid grid;
  grid.edge = 2;
  grid.columns = 3;
  grid.rows = 2;
  std::vector<VolumeContent> cells;
  std::vector<VolumePart> parts;
  for (int cell = 0; cell < grid.cells(); ++cell) {
    VolumePart part = smoothPart(static_cast<uint64_t>(20 + cell), false, 0.5);
    placeCell(part, static_cast<float>(grid.centre(cell).x()), static_cast<float>(grid.centre(cell).y()), -0.75f);
    parts.push_back(part);
    cells.push_back(makeVolumeContent({part}));
  }
  const VolumeContent whole = makeVolumeContent(parts);
  SceneDrawing<VolumeContent> one;
  one.frame.low = Vec3d(-3, -2, -0.75);
  one.frame.high = Vec3d(3, 2, 1);
  one.march.minTransmittance = 0;
  one.frontToBack = {&whole};
  RayCaster<VolumeContent> ofOne(one);
  const RandomStream random(12, 1);
  int crossing = 0;
  double opacities = 0;
  constexpr uint64_t kRays = 2000;
  for (uint64_t i = 0; i < kRays; ++i) {
    const auto value = [&](uint64_t k) { return 2 * random.uniformDouble(8 * i + k) - 1; };
    const Vec3d origin = (i % 2 ? 1.0 : 2.0) * Vec3d(3 * value(0), 2 * value(1), value(2));
    const Vec3d target(3 * value(3), 2 * value(4), 0.7 * value(5));
    const SceneRay ray{origin, (target - origin).normalized()};
    SceneDrawing<VolumeContent> drawing = one;
    drawing.frontToBack.clear();
    for (const int cell : grid.frontToBack(origin.head<2>())) drawing.frontToBack.push_back(&cells[cell]);
    MarchCounts counts, ofWhole;
    const DrawnPixel actual = RayCaster<VolumeContent>(drawing).cast(ray, INFINITY, counts);
    const DrawnPixel expected = ofOne.cast(ray, INFINITY, ofWhole);
    ASSERT_EQ(counts.samples, ofWhole.samples);
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(actual.colour[c], expected.colour[c], 1e-5) << i;
    ASSERT_NEAR(actual.transmittance, expected.transmittance, 1e-5) << i;
    ASSERT_NEAR(actual.depth, expected.depth, 1e-5 * (1 + expected.depth)) << i;
    int met = 0;
    for (const VolumePart& part : parts) met += !ownedRange(part, ray, {0.05, 100}).empty();
    crossing += met > 2;
    opacities += 1 - expected.transmittance;
  }
  EXPECT_GT(crossing, 500);
  EXPECT_GT(opacities / kRays, 0.2);
  EXPECT_LT(opacities / kRays, 0.95);
}

// Invariant 13 of docs/invariants.md: merged parts do not affect one another; no texel of one part is read on the other
// side of the wall between them.
TEST(DrawVolume, ReadsOnlyTheTexelsOfThePartThatARayIsIn) {
  std::vector<VolumePart> parts;
  for (const float x : {-1.0f, 1.0f}) {
    VolumePart part = smoothPart(x < 0 ? 31 : 32, false, 1);
    placeCell(part, x, 0);
    parts.push_back(part);
  }
  const VolumeContent before = makeVolumeContent(parts, randomNetwork(1));
  for (std::vector<uint8_t>* bytes :
       {&parts[1].voxelBytes, &parts[1].planeBytes[0], &parts[1].planeBytes[1], &parts[1].planeBytes[2]}) {
    for (uint8_t& byte : *bytes) byte = static_cast<uint8_t>(255 - byte);
  }
  const VolumeContent after = makeVolumeContent(parts, randomNetwork(1));
  TileFrame frame;
  frame.low = Vec3d(-2, -1, -1);
  frame.high = Vec3d(2, 1, 1);
  const SceneDrawing<VolumeContent> one{frame, {&before}, nullptr, {}}, other{frame, {&after}, nullptr, {}};
  RayCaster<VolumeContent> casterOne(one), casterOther(other);
  const RandomStream random(13, 1);
  MarchCounts counts;
  int different = 0;
  for (uint64_t i = 0; i < 500; ++i) {
    // Rays start beside the wall, at a distance of a hundredth of a voxel or more.
    const double x = (i % 2 ? 1 : -1) * std::exp2(-11.0 * random.uniformDouble(3 * i));
    const Vec3d origin(x, 2 * random.uniformDouble(3 * i + 1) - 1, 2),
        down(0, 2 * random.uniformDouble(3 * i + 2) - 1, -3);
    const SceneRay ray{origin, down.normalized()};
    const DrawnPixel a = casterOne.cast(ray, INFINITY, counts), b = casterOther.cast(ray, INFINITY, counts);
    if (x < 0) {
      ASSERT_EQ(a.colour, b.colour) << x;
      ASSERT_EQ(a.transmittance, b.transmittance) << x;
    } else {
      different += a.colour != b.colour;
    }
  }
  EXPECT_GT(different, 200);
}

TEST(DrawVolume, SeesNothingOfAContentThatHoldsNothingWhateverItsNetwork) {
  VolumePart nothing;
  placeCell(nothing, -3, 0);
  nothing.voxels = 32;
  nothing.planes = 64;
  makeVolume(nothing, smoothVolume(1, 0));
  const VolumeContent empty = makeVolumeContent({nothing}, randomNetwork(1));
  SceneDrawing<VolumeContent> drawing = village().drawing();
  const RenderedView without = drawn(drawing);
  drawing.frontToBack.insert(drawing.frontToBack.begin(), &empty);
  const RenderedView with = drawn(drawing);
  EXPECT_EQ(without.colour.pixels, with.colour.pixels);
  EXPECT_EQ(without.opacity.pixels, with.opacity.pixels);
}

TEST(DrawVolume, SeesTheBackgroundBlockOnlyBehindTheBox) {
  // Everything outside the box is opaque: rays that miss the box see it where they begin, others only behind the box.
  VolumeContent fog = village().backgroundBlock;
  VolumePart& part = fog.parts[0];
  part = VolumePart{};
  part.contracted = part.backgroundBlock = true;
  part.scale = {2, 1, 1};
  part.voxels = 32;
  part.planes = 64;
  makeSolid(
      part, [](const Vec3d&) { return true; }, [](const Vec3d&) { return Vec3d(0.1, 0.2, 0.8); });
  SceneDrawing<VolumeContent> drawing = village().drawing(false);
  const RenderedView without = drawn(drawing);
  drawing.backgroundBlock = &fog;
  const RenderedView with = drawn(drawing);
  int behind = 0, alone = 0;
  for (int y = 0; y < camera().height; ++y) {
    for (int x = 0; x < camera().width; ++x) {
      const Vec3d d = *camera().directionInCamera(Vec2d(x + 0.5, y + 0.5));
      const RayRange box = clipToBox({pose().translation, pose().rotation * d}, drawing.frame.low, drawing.frame.high,
                                     {drawing.frame.near, 1e9});
      const double depth = *with.depth.at(x, y), seen = *without.opacity.at(x, y);
      EXPECT_GT(*with.opacity.at(x, y), 0.99);
      if (box.empty()) {
        EXPECT_LT(depth, 0.4) << x << "," << y;  // within one step
        ++alone;
      } else if (seen == 0) {
        EXPECT_NEAR(depth, box.far * d.z(), 0.4) << x << "," << y;
        ++behind;
      } else if (seen > 0.997) {
        EXPECT_NEAR(depth, *without.depth.at(x, y), 0.02) << x << "," << y;
      }
    }
  }
  EXPECT_GT(behind, 500);
  EXPECT_GT(alone, 500);
}

TEST(DrawVolume, SeesBlocksThatOwnWhatLiesOutsideFromWhereTheBoxIsEntered) {
  VolumePart part;
  part.contracted = true;
  part.low = {0, -INFINITY, -INFINITY};
  part.high = {INFINITY, INFINITY, INFINITY};
  part.voxels = 32;
  part.planes = 64;
  makeSolid(
      part, [](const Vec3d&) { return true; }, [](const Vec3d&) { return Vec3d(0.1, 0.2, 0.8); });
  const VolumeContent border = makeVolumeContent({part});
  SceneDrawing<VolumeContent> drawing{{}, {&border}, nullptr, {}};
  RayCaster<VolumeContent> caster(drawing);
  MarchCounts counts;
  const auto castRayDepth = [&](const Vec3d& origin, const Vec3d& target) {
    const DrawnPixel ray = caster.cast({origin, (target - origin).normalized()}, INFINITY, counts);
    return ray.depth / (1 - ray.transmittance);
  };
  EXPECT_NEAR(castRayDepth(Vec3d(5, 0, 0), Vec3d(0, 0, 0)), 4, 0.1);  // at the box, not where its region begins
  EXPECT_NEAR(castRayDepth(Vec3d(0.5, 0.1, 0), Vec3d(5, 0.1, 0)), 0.05, 0.1);  // from inside the box
  EXPECT_NEAR(castRayDepth(Vec3d(-5, 3, 0), Vec3d(5, 3, 0)), 5, 0.3);          // past the box: where its region begins
  EXPECT_NEAR(castRayDepth(Vec3d(-0.5, 0, 0), Vec3d(0.5, 0, 0)), 0.5, 0.1);
}

TEST(DrawVolume, SeesBlocksThatOwnWhatLiesOutsideBehindTheBoxToo) {
  // Three blocks in a row: the outer two contain only a wall far outside, the inner one contains nothing.
  const auto wall = [](const Vec3d& x) { return std::abs(x.x()) > 8; };
  std::vector<VolumeContent> contents;
  for (const float x : {-2.0f, 0.0f, 2.0f}) {
    VolumePart part;
    placeCell(part, x, 0, -0.5f, 0.5f);
    part.voxels = 64;
    part.planes = 256;
    if (x == 0) {
      makeVolume(part, smoothVolume(1, 0));
    } else {
      part.contracted = true;
      for (const int a : {1, 2}) {
        part.low[a] = -1e6f;
        part.high[a] = 1e6f;
      }
      (x < 0 ? part.low : part.high)[0] = x < 0 ? -1e6f : 1e6f;
      makeSolid(part, wall, [](const Vec3d&) { return Vec3d(0.1, 0.2, 0.8); });
    }
    contents.push_back(makeVolumeContent({part}));
  }
  SceneDrawing<VolumeContent> drawing;
  drawing.frame.low = Vec3d(-3, -1, -0.5);
  drawing.frame.high = Vec3d(3, 1, 0.5);
  MarchCounts counts;
  const auto wallSeen = [&](const Vec3d& origin, const Vec3d& direction) {
    drawing.frontToBack = {&contents[0], &contents[1], &contents[2]};
    if (origin.x() > 0) std::reverse(drawing.frontToBack.begin(), drawing.frontToBack.end());
    const DrawnPixel ray = RayCaster<VolumeContent>(drawing).cast({origin, direction.normalized()}, INFINITY, counts);
    EXPECT_GT(1 - ray.transmittance, 0.99);
    return (origin + ray.depth / (1 - ray.transmittance) * direction.normalized()).x();
  };
  EXPECT_NEAR(wallSeen(Vec3d(0, 0, 0), Vec3d(1, 0.1, 0.02)), 8, 1.5);       // from the empty block
  EXPECT_NEAR(wallSeen(Vec3d(-2.5, 0, 0), Vec3d(1, 0.05, 0.02)), 8, 1.5);   // through all three
  EXPECT_NEAR(wallSeen(Vec3d(2.5, 0, 0), Vec3d(-1, 0.05, 0.02)), -8, 1.5);  // and back
  EXPECT_NEAR(wallSeen(Vec3d(2.5, 0.5, 4), Vec3d(1, 0.1, 0.1)), 8, 1.5);    // past the box
  EXPECT_NEAR(wallSeen(Vec3d(-6, 0, 0), Vec3d(1, 0.01, 0.01)), 8, 1.5);     // not the wall behind the camera
}

TEST(DrawVolume, EndsRaysAtOpaqueSurfaces) {
  const RenderedView free = drawn(village().drawing());
  ImageF opaque(camera().width, camera().height, 1, INFINITY);
  for (int y = 0; y < opaque.height; ++y) {
    for (int x = 0; x < opaque.width; ++x) {
      if (x < 80) *opaque.at(x, y) = 0.01f;
      if (x >= 160) *opaque.at(x, y) = 1000;
    }
  }
  const RenderedView ended = drawn(village().drawing(), &opaque);
  for (int y = 0; y < opaque.height; ++y) {
    for (int x = 0; x < opaque.width; ++x) {
      if (x < 80) {
        EXPECT_EQ(*ended.opacity.at(x, y), 0);
      } else if (x < 160 || *free.depth.at(x, y) < 100) {
        EXPECT_NEAR(*ended.opacity.at(x, y), *free.opacity.at(x, y), 1e-4);
      }
    }
  }
}

TEST(DrawVolume, DrawsNothingWhereTheLensHasNoDirection) {
  Camera fisheye = camera();
  fisheye.lens = LensModel::openCvFisheye;
  fisheye.parameters = {20, 20, 120, 90, -0.1, 0, 0, 0};
  ASSERT_FALSE(fisheye.directionInCamera(Vec2d(0.5, 0.5)));
  ThreadPool pool(1);
  const RenderedView view = drawScene(village().drawing(), fisheye, pose(), nullptr, pool);
  EXPECT_EQ(*view.opacity.at(0, 0), 0);
  EXPECT_GT(*view.opacity.at(120, 90), 0.9);
  for (const float value : view.depth.pixels) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace tessera
