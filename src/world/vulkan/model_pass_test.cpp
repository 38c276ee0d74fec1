#include "world/vulkan/model_pass.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "gpu/testing/test_context.h"
#include "world/vulkan/world_renderer.h"

namespace tessera {
namespace {

// A square of 2 m that faces south, with its corners at x and z of -1 and 1.
Model southernSquare() {
  Model model;
  for (const auto& [x, z] :
       {std::pair(-1.0f, -1.0f), std::pair(1.0f, -1.0f), std::pair(1.0f, 1.0f), std::pair(-1.0f, 1.0f)}) {
    ModelVertex& vertex = model.vertices.emplace_back();
    vertex.position = {x, 0, z};
    vertex.normal = -Vec3f::UnitY();
    vertex.place = {0.5f + 0.5f * x, 0.5f - 0.5f * z};
  }
  model.corners = {0, 1, 2, 0, 2, 3};
  model.materials.emplace_back().isLit = false;
  return model;
}

class ModelPassTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  // Returns the image of a camera 4 m south of the origin, or north, that sees 4 m across it.
  RenderedView drawn(const Model& model, const PlacedModel& placed = {}, bool fromNorth = false,
                     LensModel lens = LensModel::pinhole) {
    const auto stream = std::make_shared<GpuStream>(context_);
    auto pass = std::make_unique<ModelPass>(stream, std::span(&model, 1), std::vector{placed});
    WorldRenderer world(stream, {}, std::move(pass), {}, Eigen::Array3f::Zero());
    const Camera camera = {64, 64, lens, {64, 64, 32, 32}};
    Pose pose;
    const double side = fromNorth ? -1 : 1;
    pose.rotation.col(0) = side * Vec3d::UnitX();
    pose.rotation.col(1) = -Vec3d::UnitZ();
    pose.rotation.col(2) = side * Vec3d::UnitY();
    pose.translation = {0, -4 * side, 0};
    return world.render(camera, pose);
  }
  static Eigen::Array3f colourAt(const RenderedView& view, int x, int y) {
    return Eigen::Map<const Eigen::Array3f>(view.colour.at(x, y));
  }

  std::shared_ptr<GpuContext> context_;
};

TEST_F(ModelPassTest, ShowsTheFrontOfASurfaceAtItsDepth) {
  const Model model = southernSquare();
  const RenderedView view = drawn(model);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool isInside = x >= 16 && x < 48 && y >= 16 && y < 48;
      ASSERT_EQ(*view.opacity.at(x, y), isInside ? 1 : 0) << x << ", " << y;
      ASSERT_NEAR(*view.depth.at(x, y), isInside ? 4 : 0, 1e-4);
    }
  }
  EXPECT_EQ(*drawn(model, {}, true).opacity.at(32, 32), 0) << "its back";
  Model both = model;
  both.materials[0].isDoubleSided = true;
  EXPECT_EQ(*drawn(both, {}, true).opacity.at(32, 32), 1);
  EXPECT_THROW(drawn(model, {}, false, LensModel::openCvFisheye), Error);
}

TEST_F(ModelPassTest, PlacesModelsByScaleThenRotationThenPosition) {
  PlacedModel placed;
  placed.scale = {0.5, 1, 1};
  placed.rotation = Eigen::AngleAxisd(std::acos(0.0), Vec3d::UnitY()).toRotationMatrix();  // x to -z
  placed.position = {0, 0, 0.5};
  const RenderedView view = drawn(southernSquare(), placed);
  // It is now 2 m wide and 1 m high.
  for (const auto& [x, y, opacity] : {std::tuple(17, 24, 1.0f), std::tuple(46, 24, 1.0f), std::tuple(32, 17, 1.0f),
                                      std::tuple(32, 31, 1.0f), std::tuple(32, 33, 0.0f), std::tuple(32, 14, 0.0f)}) {
    EXPECT_EQ(*view.opacity.at(x, y), opacity) << x << ", " << y;
  }
}

TEST_F(ModelPassTest, DrawsTexturesUprightAndWhereTheyAreOpaqueEnough) {
  Model model = southernSquare();
  model.materials[0].texture = 0;
  ImageU8& image = model.textures.emplace_back(8, 8, 4);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      uint8_t* texel = image.at(x, y);
      texel[0] = x < 4 ? 200 : 0;
      texel[1] = y < 4 ? 100 : 0;
      texel[2] = 50;
      texel[3] = x < 4 || y < 4 ? 255 : 100;
    }
  }
  const auto near = [](const Eigen::Array3f& a, float r, float g, float b) {
    return (255 * a - Eigen::Array3f(r, g, b)).abs().maxCoeff() < 1.5f;
  };
  RenderedView view = drawn(model);
  EXPECT_TRUE(near(colourAt(view, 20, 20), 200, 100, 50)) << colourAt(view, 20, 20);
  EXPECT_TRUE(near(colourAt(view, 44, 20), 0, 100, 50));
  EXPECT_TRUE(near(colourAt(view, 20, 44), 200, 0, 50));
  EXPECT_TRUE(near(colourAt(view, 44, 44), 0, 0, 50));
  model.materials[0].cutoff = 0.5f;
  view = drawn(model);
  EXPECT_EQ(*view.opacity.at(44, 44), 0);
  EXPECT_EQ(*view.opacity.at(20, 44), 1);
}

TEST_F(ModelPassTest, LightsWhatFacesTheSunMoreAndMinifiesTextures) {
  Model model = southernSquare();
  model.materials[0].isLit = true;
  const float south = colourAt(drawn(model), 32, 32).mean();
  for (ModelVertex& vertex : model.vertices) vertex.normal = Vec3f::UnitZ();
  const float up = colourAt(drawn(model), 32, 32).mean();
  for (ModelVertex& vertex : model.vertices) vertex.normal = -Vec3f::UnitZ();
  const float down = colourAt(drawn(model), 32, 32).mean();
  EXPECT_GT(up, 0.95f) << "a white roof is white";
  EXPECT_GT(up, south + 0.05f);
  EXPECT_GT(south, down + 0.1f);
  // Stripes that are much narrower than pixels give their mean.
  model = southernSquare();
  model.materials[0].texture = 0;
  ImageU8& image = model.textures.emplace_back(1024, 4, 4, 255);
  for (int x = 0; x < 1024; ++x) {
    for (int y = 0; y < 4; ++y) std::fill_n(image.at(x, y), 3, static_cast<uint8_t>(x % 2 == 0 ? 200 : 100));
  }
  EXPECT_NEAR(colourAt(drawn(model), 30, 32).mean(), 150 / 255.0, 0.02);
}

TEST_F(ModelPassTest, ReadsRoughnessAndMetalnessAsNumbersAndEmissionAsAColour) {
  Model model = southernSquare();
  model.materials[0].isLit = true;
  model.materials[0].metalness = 1;
  const float metal = colourAt(drawn(model), 32, 32).mean();
  model.materials[0].metalness = 0;
  const float paint = colourAt(drawn(model), 32, 32).mean();
  ASSERT_GT(std::abs(metal - paint), 0.05f);
  model.materials[0].metalness = 1;
  model.materials[0].surfaceTexture = 0;
  ImageU8& surface = model.textures.emplace_back(4, 4, 4, 255);
  for (size_t p = 0; p < surface.pixelCount(); ++p) surface.pixels[4 * p + 2] = 128;
  const auto linear = [](float x) { return std::pow((x + 0.055f) / 1.055f, 2.4f); };
  const Eigen::Array3f half = colourAt(drawn(model), 32, 32);
  model.materials[0].surfaceTexture = -1;
  const Eigen::Array3f whole = colourAt(drawn(model), 32, 32);
  model.materials[0].metalness = 0;
  const Eigen::Array3f none = colourAt(drawn(model), 32, 32);
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(linear(half[c]), 0.5f * (linear(whole[c]) + linear(none[c])), 0.01f) << c;
  // A black surface that glows.
  model.materials[0].baseColour = {0, 0, 0};
  model.materials[0].isLit = false;
  model.materials[0].emission = {1, 1, 0};
  model.materials[0].emissionTexture = 0;
  for (size_t p = 0; p < model.textures[0].pixelCount(); ++p) model.textures[0].pixels[4 * p] = 100;
  const Eigen::Array3f glow = 255 * colourAt(drawn(model), 32, 32);
  EXPECT_LT((glow - Eigen::Array3f(100, 255, 0)).abs().maxCoeff(), 1.5f) << glow;
}

TEST_F(ModelPassTest, DrawsPlacesThatAreNegativeOrNoNumbers) {
  Model model = southernSquare();
  model.materials[0].texture = 0;
  ImageU8& image = model.textures.emplace_back(8, 8, 4, 255);
  for (int y = 0; y < 8; ++y)
    for (int x = 0; x < 8; ++x) *image.at(x, y) = x < 4 ? 200 : 0;
  const RenderedView straight = drawn(model);
  Model shifted = model;
  for (ModelVertex& vertex : shifted.vertices) vertex.place[0] -= 3;
  const RenderedView view = drawn(shifted);
  for (int x = 18; x < 46; ++x) EXPECT_NEAR(colourAt(view, x, 30)[0], colourAt(straight, x, 30)[0], 0.01f) << x;
  for (ModelVertex& vertex : shifted.vertices) vertex.place[0] = std::nanf("");
  EXPECT_EQ(*drawn(shifted).opacity.at(32, 32), 1);
}

}  // namespace
}  // namespace tessera
