#include "apps/viewer/reloading_render_source.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "representations/field/train/train_field.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

void train(const CubeScene& scene, const fs::path& model, int64_t steps) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainFieldOptions options;
  options.config.samplesPerStep = 1024;
  options.config.occupancyResolution = 16;
  options.loop.steps = 4;
  options.loop.resume = true;
  options.loop.progress = false;
  int64_t asked = 0;
  options.loop.stopRequested = [&] { return asked++ >= steps; };
  trainField(*device, scene.capture(), model, options);
}

std::string findFact(const ReloadingRenderSource& opened, const std::string& name) {
  const FrameSource::Facts facts = opened.facts();
  const auto it = std::find_if(facts.begin(), facts.end(), [&](const auto& fact) { return fact.first == name; });
  return it == facts.end() ? "" : it->second;
}

TEST(ReloadingRenderSource, DrawsTheNewestCheckpointOfATraining) {
  const CubeScene scene;
  const fs::path model = scene / "model";
  train(scene, model, 2);
  ReloadingRenderSource opened(model, {"cpu", 2}, {});
  EXPECT_EQ(findFact(opened, "Step"), "2 of 4");
  EXPECT_FALSE(opened.refresh());
  const Camera& camera = scene.capture().cameras[0];
  const Pose& pose = scene.capture().photos[0].worldFromCamera;
  const RenderedView before = opened.renderer().render(camera, pose);
  train(scene, model, 2);
  EXPECT_TRUE(opened.refresh());
  EXPECT_EQ(findFact(opened, "Step"), "4 of 4");
  EXPECT_NE(findFact(opened, "Training PSNR"), "");
  EXPECT_NE(opened.renderer().render(camera, pose).colour.pixels, before.colour.pixels);
  EXPECT_FALSE(opened.refresh());
}

TEST(ReloadingRenderSource, SaysWhatIsWrongWithACheckpointThatCannotBeRead) {
  const CubeScene scene;
  const fs::path model = scene / "model";
  train(scene, model, 2);
  ReloadingRenderSource opened(model, {"cpu", 2}, {});
  train(scene, model, 2);
  const fs::path checkpoint = model / ModelFolder(model).manifest()->files[0];
  fs::resize_file(checkpoint, 100);
  EXPECT_THROW(opened.refresh(), Error);
}

}  // namespace
}  // namespace tessera
