#include "representations/field/train/field_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/order_statistics.h"
#include "representations/field/testing/trained_cube.h"

namespace tessera {
namespace {

// One trained model for all tests of this file.
class RenderedField : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    scene_ = new CubeScene;
    trained_ = new TrainedCube(*scene_, cubeConfig(), 300);
    renderer_ = new FieldRenderer(trained_->trainer->model());
  }
  static void TearDownTestSuite() {
    delete renderer_;
    delete trained_;
    delete scene_;
  }
  static const Pose& pose(int photo = 3) { return scene_->capture().photos[photo].worldFromCamera; }
  static const Camera& camera() { return scene_->capture().cameras[0]; }

  static CubeScene* scene_;
  static TrainedCube* trained_;
  static FieldRenderer* renderer_;
};

CubeScene* RenderedField::scene_ = nullptr;
TrainedCube* RenderedField::trained_ = nullptr;
FieldRenderer* RenderedField::renderer_ = nullptr;

TEST_F(RenderedField, IsPremultipliedAndOpaqueWhereTheCubeIs) {
  const RenderedView view = renderer_->render(camera(), pose(), nullptr), truth = scene_->truth(camera(), pose());
  double inside = 0, outside = 0;
  int insides = 0, outsides = 0;
  for (size_t i = 0; i < view.opacity.pixels.size(); ++i) {
    EXPECT_GE(view.opacity.pixels[i], 0);
    EXPECT_LE(view.opacity.pixels[i], 1.0001f);
    for (int k = 0; k < 3; ++k) EXPECT_LE(view.colour.pixels[3 * i + k], view.opacity.pixels[i] + 1e-4f);
    if (truth.opacity.pixels[i] > 0.99f) inside += view.opacity.pixels[i], ++insides;
    if (truth.opacity.pixels[i] == 0) outside += view.opacity.pixels[i], ++outsides;
  }
  ASSERT_GT(insides, 100);
  ASSERT_GT(outsides, 100);
  EXPECT_GT(inside / insides, 0.9);
  EXPECT_LT(outside / outsides, 0.25);
}

TEST_F(RenderedField, HasTheDepthOfTheCubeInWorldUnits) {
  const RenderedView view = renderer_->render(camera(), pose(), nullptr), truth = scene_->truth(camera(), pose());
  std::vector<double> errors;
  for (size_t i = 0; i < view.opacity.pixels.size(); ++i) {
    if (truth.opacity.pixels[i] < 0.99f) continue;
    errors.push_back(std::abs(view.depth.pixels[i] / view.opacity.pixels[i] - truth.depth.pixels[i]));
  }
  ASSERT_GT(errors.size(), 100u);
  EXPECT_LT(upperMedian(errors), 0.15);  // the depth is about 1.3, and the cube is 1 wide
}

TEST_F(RenderedField, IsTheSameWhenTheImageIsRenderedInParts) {
  const Camera whole = camera().scaledTo(180, 144);  // more rays than one batch of the renderer
  const RenderedView picture = renderer_->render(whole, pose(), nullptr);
  for (const auto& [left, top] : {std::pair(0, 0), std::pair(90, 0), std::pair(60, 100)}) {
    Camera piece = whole;
    piece.width = 90;
    piece.height = 44;
    piece.parameters[2] -= left;
    piece.parameters[3] -= top;
    const RenderedView part = renderer_->render(piece, pose(), nullptr);
    double worst = 0;
    for (int y = 0; y < piece.height; ++y) {
      for (int x = 0; x < piece.width; ++x) {
        for (int k = 0; k < 3; ++k) {
          worst = std::max<double>(worst, std::abs(part.colour.at(x, y)[k] - picture.colour.at(x + left, y + top)[k]));
        }
        worst = std::max<double>(worst, std::abs(*part.depth.at(x, y) - *picture.depth.at(x + left, y + top)));
      }
    }
    EXPECT_LT(worst, 5e-3) << left << "," << top;
  }
}

TEST_F(RenderedField, HasTheDensitiesAndColoursOfTheTrainingPass) {
  FieldModel& model = trained_->trainer->model();
  Device& device = model.device();
  constexpr uint32_t kRays = 64, kSamples = 1 << 12;
  ImageRays rays(device, kRays);
  rays.begin(makeRayCamera(camera(), pose(), model.frame()), model.frame(), PixelLattice::whole(camera()));
  const ImageRays::Piece piece = rays.piece(static_cast<size_t>(camera().width) * 16, kRays);
  RaySamples seen(device, kRays, kSamples);
  Array<uint32_t> counters = device.array<uint32_t>(RaySamples::kCounters);
  seen.counters = counters;
  const FieldModel::Rays fieldRays{piece.rays, piece.origins, piece.directions, {}, {}};
  struct Values {
    std::vector<uint32_t> counters;
    std::vector<float> densities, colours;
  };
  const auto read = [&](const RadianceField::Output& output) {
    Values values{device.read(counters.all()), {}, {}};
    const std::vector<float> densities = device.read(output.logDensity.data),
                             colours = device.read(output.colours.data);
    for (uint32_t i = 0; i < values.counters[MarchRounds::kVisible]; ++i) {
      values.densities.push_back(densities[output.logDensity.offset(i, 0)]);
      for (uint32_t k = 0; k < 3; ++k) values.colours.push_back(colours[output.colours.offset(i, k)]);
    }
    return values;
  };
  model.sample(fieldRays, FieldRenderer::kMinTransmittance, seen);
  const Values training =
      read(model.field().forward(seen.samples(), seen.positions, piece.directions, seen.rayOfSample, true));
  const Values rendering =
      read(model.render(fieldRays, model.occupancy().bits(), FieldRenderer::kMinTransmittance, seen));
  ASSERT_GT(training.densities.size(), 100u);
  EXPECT_EQ(rendering.counters, training.counters);
  EXPECT_EQ(rendering.densities, training.densities);
  EXPECT_EQ(rendering.colours, training.colours);
}

TEST_F(RenderedField, KeepsWhatTrainingPhotosSeeWhenUnseenCellsAreCulled) {
  FieldRenderer whole(trained_->trainer->model());
  const RenderedView before = whole.render(camera(), pose(), nullptr);
  const uint64_t densities = whole.densitiesEvaluated();
  FieldRenderer culled(trained_->trainer->model());
  culled.cullUnseen(scene_->capture(), {});
  const uint64_t culling = culled.densitiesEvaluated();
  const RenderedView after = culled.render(camera(), pose(), nullptr);
  EXPECT_LT(culled.densitiesEvaluated() - culling, densities);
  double error = 0;
  for (size_t i = 0; i < before.colour.pixels.size(); ++i) {
    error += std::pow(before.colour.pixels[i] - after.colour.pixels[i], 2.0);
  }
  EXPECT_GT(-10 * std::log10(error / static_cast<double>(before.colour.pixels.size())), 25) << "only fog is missing";

  CullOptions nothing;
  nothing.minWeight = 2;  // no sample has such a weight
  culled.cullUnseen(scene_->capture(), nothing);
  for (const float opacity : culled.render(camera(), pose(), nullptr).opacity.pixels) EXPECT_EQ(opacity, 0);
}

TEST_F(RenderedField, IsTheSameEveryTime) {
  const RenderedView first = renderer_->render(camera(), pose(), nullptr);
  renderer_->render(camera().scaledTo(60, 48), pose(5), nullptr);
  const RenderedView again = renderer_->render(camera(), pose(), nullptr);
  EXPECT_EQ(first.colour.pixels, again.colour.pixels);
  EXPECT_EQ(first.depth.pixels, again.depth.pixels);
}

TEST_F(RenderedField, EndsAtOpaqueThings) {
  const RenderedView free = renderer_->render(camera(), pose(), nullptr);
  const auto with = [&](float depth) {
    const ImageF opaque(camera().width, camera().height, 1, depth);
    return renderer_->render(camera(), pose(), &opaque);
  };
  const float infinity = std::numeric_limits<float>::infinity();
  const RenderedView nothing = with(infinity), behind = with(50), before = with(0.6f), at = with(0);
  EXPECT_EQ(nothing.colour.pixels, free.colour.pixels);
  EXPECT_EQ(behind.colour.pixels, free.colour.pixels);
  double left = 0, all = 0;
  for (size_t i = 0; i < free.opacity.pixels.size(); ++i) {
    EXPECT_LE(before.opacity.pixels[i], free.opacity.pixels[i] + 1e-5f);
    left += before.opacity.pixels[i];
    all += free.opacity.pixels[i];
    EXPECT_EQ(at.opacity.pixels[i], 0);
  }
  EXPECT_LT(left, 0.2 * all);  // the cube begins at 1
}

TEST_F(RenderedField, EndsPixelByPixelAtOpaqueThings) {
  const RenderedView free = renderer_->render(camera(), pose(), nullptr);
  ImageF opaque(camera().width, camera().height, 1, std::numeric_limits<float>::infinity());
  for (int y = 0; y < opaque.height; ++y) {
    for (int x = 0; x < opaque.width / 2; ++x) *opaque.at(x, y) = 0.01f;
  }
  const RenderedView half = renderer_->render(camera(), pose(), &opaque);
  for (int y = 0; y < opaque.height; ++y) {
    for (int x = 0; x < opaque.width; ++x) {
      EXPECT_EQ(*half.opacity.at(x, y), x < opaque.width / 2 ? 0 : *free.opacity.at(x, y)) << x << "," << y;
    }
  }
}

TEST_F(RenderedField, IsTransparentOutsideTheImageOfADistortedLens) {
  Camera fisheye = camera();
  fisheye.lens = LensModel::openCvFisheye;
  fisheye.parameters = {6, 6, 20, 16, -0.1, 0, 0, 0};  // the corners lie beyond the fold
  ASSERT_FALSE(fisheye.directionInCamera(Vec2d(0.5, 0.5)));
  const RenderedView view = renderer_->render(fisheye, pose(), nullptr);
  EXPECT_EQ(*view.opacity.at(0, 0), 0);
  for (const float value : view.depth.pixels) EXPECT_TRUE(std::isfinite(value));
}

}  // namespace
}  // namespace tessera
