#include "train/model_folder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "train/testing/test_support.h"

namespace tessera {
namespace {

Bytes block(size_t size, int value) {
  return Bytes(size, static_cast<std::byte>(value));
}

std::vector<std::string> blockFiles(const fs::path& root) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(root / "blocks/0")) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end(), naturalLess);
  return names;
}

std::string catchErrorMessage(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(ModelFolder, HoldsNoModelWhileThereIsNoManifest) {
  const TemporaryFolder folder;
  EXPECT_FALSE(ModelFolder(folder.path()).manifest());
  EXPECT_FALSE(ModelFolder(folder / "nowhere").manifest());
}

TEST(ModelFolder, ReadsBackWhatWasCommitted) {
  const TemporaryFolder folder;
  const ModelFolder model(folder / "new/model");
  model.commit({"field", 120, 500, {}}, 1, [](uint32_t) { return block(100, 7); });
  const auto manifest = model.manifest();
  ASSERT_TRUE(manifest);
  EXPECT_EQ(manifest->method, "field");
  EXPECT_EQ(manifest->step, 120);
  EXPECT_EQ(manifest->plannedSteps, 500);
  ASSERT_EQ(manifest->files.size(), 1u);
  EXPECT_EQ(readFile(model.root() / manifest->files[0]), block(100, 7));
}

TEST(ModelFolder, KeepsTheLastCheckpointsOnly) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  for (const int64_t step : {8, 9, 10, 100})
    model.commit({"field", step, 100, {}}, 1, [](uint32_t) { return block(10, 1); });
  EXPECT_EQ(blockFiles(folder.path()), (std::vector<std::string>{"step-10.safetensors", "step-100.safetensors"}));
  model.commit(
      {"field", 101, 200, {}}, 1, [](uint32_t) { return block(10, 1); }, 1);
  EXPECT_EQ(blockFiles(folder.path()), (std::vector<std::string>{"step-101.safetensors"}));
}

TEST(ModelFolder, KeepsTheFilesOfUnchangedBlocks) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  for (const int64_t step : {5, 6, 7, 8}) {
    model.commit({"volume", step, 9, {}}, 2, [&](uint32_t part) -> std::optional<Bytes> {
      if (part == 1 && step > 5) return std::nullopt;
      return block(10, static_cast<int>(step));
    });
  }
  const auto manifest = model.manifest();
  ASSERT_TRUE(manifest);
  EXPECT_EQ(manifest->step, 8);
  EXPECT_EQ(readFile(model.root() / manifest->files.at(0)), block(10, 8));
  EXPECT_EQ(readFile(model.root() / manifest->files.at(1)), block(10, 5));
}

TEST(ModelFolder, HoldsTheLastCommitIfKilledWhileWritingABlock) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  model.commit({"field", 10, 100, {}}, 1, [](uint32_t) { return block(100, 1); });
  // These are a block that was being written, and one whose manifest was not written yet.
  writeFileAtomically(folder / "blocks/0/step-20.safetensors.partial-123", "half");
  writeFileAtomically(folder / "blocks/0/step-20.safetensors", "whole");
  writeFileAtomically(folder / "manifest.json.partial-123", "{\"met");
  const auto manifest = model.manifest();
  ASSERT_TRUE(manifest);
  EXPECT_EQ(manifest->step, 10);
  EXPECT_EQ(readFile(folder.path() / manifest->files[0]), block(100, 1));
  // The next commit removes the partial files.
  model.commit({"field", 20, 100, {}}, 1, [](uint32_t) { return block(100, 2); });
  EXPECT_EQ(model.manifest()->step, 20);
  EXPECT_EQ(readFile(folder / "blocks/0/step-20.safetensors"), block(100, 2));
  EXPECT_EQ(blockFiles(folder.path()), (std::vector<std::string>{"step-10.safetensors", "step-20.safetensors"}));
}

TEST(ModelFolder, NeverRemovesTheBlockThatItsManifestNames) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  // Later checkpoints, left by a longer run, must not cause the new checkpoint to be removed.
  for (const int64_t step : {500, 600})
    model.commit({"field", step, 600, {}}, 1, [](uint32_t) { return block(10, 1); });
  fs::remove(folder / "manifest.json");
  model.commit({"field", 5, 600, {}}, 1, [](uint32_t) { return block(10, 2); });
  ASSERT_TRUE(model.manifest());
  EXPECT_EQ(readFile(folder.path() / model.manifest()->files[0]), block(10, 2));
}

TEST(ModelFolder, ReportsAMissingBlock) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  model.commit({"field", 10, 100, {}}, 1, [](uint32_t) { return block(100, 1); });
  fs::remove(folder / "blocks/0/step-10.safetensors");
  const std::string error = catchErrorMessage([&] { model.manifest(); });
  EXPECT_TRUE(contains(error, "manifest.json")) << error;
  EXPECT_TRUE(contains(error, "step-10.safetensors")) << error;
}

TEST(ModelFolder, RejectsMalformedManifests) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "here.safetensors", "block");
  for (const char* text : {"", "{", "[]", "{}", R"({"method": "field", "step": 1, "planned_steps": 2})",
                           R"({"method": 3, "step": 1, "planned_steps": 2, "files": []})",
                           R"({"method": "field", "step": "one", "planned_steps": 2, "files": ["here.safetensors"]})",
                           R"({"method": "field", "step": 1, "planned_steps": 2, "files": []})",
                           R"({"method": "field", "step": -1, "planned_steps": 2, "files": ["here.safetensors"]})",
                           R"({"method": "field", "step": 1, "planned_steps": 2, "files": ["../outside.safetensors"]})",
                           R"({"method": "field", "step": 1, "planned_steps": 2, "files": ["/etc/passwd"]})"}) {
    writeFileAtomically(folder / "manifest.json", text);
    const std::string error = catchErrorMessage([&] { ModelFolder(folder.path()).manifest(); });
    EXPECT_TRUE(contains(error, "manifest.json")) << text << ": " << error;
  }
}

TEST(ModelFolder, StoresItsPlacementInTheWorld) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  ModelPlacement placement;
  placement.frame = {{1.0 / 3, -200.125, 3e-9}, 0.1 + 0.2};
  placement.sourceFromWorld << 0, -2, 0, 500000.25, 2, 0, 0, 4.5e6, 0, 0, 2, 12, 0, 0, 0, 1;
  placement.capture = "some/../capture";
  placement.trainedOn = {"cam0/1.jpg", "Straße \"7\".png"};
  model.writePlacement(placement, "field");
  const ModelPlacement read = model.readPlacement();
  EXPECT_EQ(read.frame.centre, placement.frame.centre);
  EXPECT_EQ(read.frame.scale, placement.frame.scale);
  EXPECT_EQ(read.sourceFromWorld, placement.sourceFromWorld);
  EXPECT_EQ(read.capture, fs::absolute("capture"));
  EXPECT_EQ(read.trainedOn, placement.trainedOn);
}

TEST(ModelFolder, ChecksTheCaptureThatItWasTrainedOn) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  Capture capture;
  capture.root = "flight";
  capture.sourceFromWorld(0, 3) = 500000.25;
  capture.photos.resize(3);
  for (int i = 0; i < 3; ++i) capture.photos[i].name = std::string(1, static_cast<char>('a' + i));
  capture.photos[1].split = Split::test;
  ModelPlacement placement;
  placement.sourceFromWorld = capture.sourceFromWorld;
  placement.capture = capture.root;
  placement.trainedOn = trainingNames(capture);
  EXPECT_EQ(placement.trainedOn, (std::vector<std::string>{"a", "c"}));
  model.writePlacement(placement, "field");
  requireTrainedOn(model, capture);
  EXPECT_TRUE(trainedOnAmong(model, capture, Split::test).empty());

  capture.photos[1].split = Split::train;
  capture.photos[2].split = Split::test;
  EXPECT_EQ(trainedOnAmong(model, capture, Split::test), std::vector<std::string>{"c"});
  requireSameWorld(model, capture);
  EXPECT_TRUE(contains(catchErrorMessage([&] { requireTrainedOn(model, capture); }), "'c' is the first that differs"));
  capture.photos[2].split = Split::train;
  EXPECT_TRUE(contains(catchErrorMessage([&] { requireTrainedOn(model, capture); }), "2 of them, not 3"));
  capture.photos.resize(1);
  EXPECT_TRUE(contains(catchErrorMessage([&] { requireTrainedOn(model, capture); }), "'c' is the first that differs"));

  capture.sourceFromWorld(0, 3) += 0.25;
  EXPECT_TRUE(contains(catchErrorMessage([&] { requireSameWorld(model, capture); }), "flight: transforms.json"));
}

TEST(ModelFolder, RejectsMalformedPlacements) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  EXPECT_TRUE(contains(catchErrorMessage([&] { model.readPlacement(); }), "blocks.json"));
  for (const char* text : {"", "{}", R"({"blocks": []})", R"({"blocks": [{"centre": [1, 2], "scale": 1}]})"}) {
    writeFileAtomically(folder / "blocks.json", text);
    EXPECT_TRUE(contains(catchErrorMessage([&] { model.readPlacement(); }), "blocks.json")) << text;
  }
}

TEST(ModelFolder, GivesItsGridOnlyToCapturesInTheSameWorld) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  Capture capture;
  capture.root = "flight";
  capture.sourceFromWorld(0, 3) = 500000.25;
  ModelPlacement placement;
  placement.sourceFromWorld = capture.sourceFromWorld;
  placement.capture = capture.root;
  placement.grid = BlockGrid{{1.0 / 3, 2, 3}, Mat3d::Identity(), 7, 3, 2, -1, 2};
  model.writePlacement(placement, "volume");
  const fs::path file = folder / "blocks.json";
  const BlockGrid grid = readGrid(file, capture);
  EXPECT_EQ(grid.originInWorld, placement.grid->originInWorld);
  EXPECT_EQ(grid.columns, 3);
  EXPECT_EQ(grid.rows, 2);
  capture.sourceFromWorld(0, 3) += 0.25;
  EXPECT_TRUE(contains(catchErrorMessage([&] { readGrid(file, capture); }), "the capture flight"));

  nlohmann::json alone = nlohmann::json::parse(readTextFile(file));
  alone.erase("source_from_world");
  writeFileAtomically(file, alone.dump());
  EXPECT_EQ(readGrid(file, capture).edge, 7) << "it names no world";
  alone["grid"]["edge"] = -7;
  writeFileAtomically(file, alone.dump());
  EXPECT_TRUE(contains(catchErrorMessage([&] { readGrid(file, capture); }), "is not a grid of blocks"));
  for (const char* text : {"", "[]", "{}", "no JSON", R"({"blocks": []})"}) {
    writeFileAtomically(file, text);
    EXPECT_TRUE(contains(catchErrorMessage([&] { readGrid(file, capture); }), "holds no grid of blocks")) << text;
  }
  EXPECT_TRUE(contains(catchErrorMessage([&] { readGrid(folder / "nowhere", capture); }), "nowhere"));
}

TEST(ModelFolder, RemembersItsPlan) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  EXPECT_FALSE(model.readPlan());
  model.writePlan({123456789012, 345});
  EXPECT_EQ(model.readPlan(), (StepPlan{123456789012, 345}));
  for (const char* text :
       {"{}", R"({"steps": 0, "planned_at_step": 1})", R"({"steps": "many", "planned_at_step": 1})", R"({"steps": 9})",
        R"({"steps": 1.5, "planned_at_step": 1})", R"({"steps": 9, "planned_at_step": -1})", "3", ""}) {
    writeFileAtomically(folder / "plan.json", text);
    EXPECT_TRUE(contains(catchErrorMessage([&] { model.readPlan(); }), "plan.json")) << text;
  }
}

TEST(ModelFolder, CutsMetricsBackToACheckpoint) {
  const TemporaryFolder folder;
  const ModelFolder model(folder.path());
  model.cutMetrics(10);  // without metrics it does nothing
  EXPECT_FALSE(fs::exists(model.metricsPath()));
  for (const int step : {5, 10, 15, 20}) model.appendMetrics({{"step", step}, {"psnr", 20.5}});
  {
    std::ofstream out(model.metricsPath(), std::ios::app);
    out << "{\"step\": 7, \"ps";  // the unfinished line of a killed run
  }
  model.cutMetrics(15);
  model.appendMetrics({{"step", 17}});
  EXPECT_EQ(readTextFile(model.metricsPath()),
            "{\"psnr\":20.5,\"step\":5}\n{\"psnr\":20.5,\"step\":10}\n"
            "{\"psnr\":20.5,\"step\":15}\n{\"step\":17}\n");
  model.cutMetrics(-1);
  EXPECT_EQ(readTextFile(model.metricsPath()), "");
}

TEST(ModelFolder, NamesMetricsThatCannotBeWritten) {
  EXPECT_TRUE(contains(catchErrorMessage([] {
                         ModelFolder("/nonexistent").appendMetrics({{"step", 1}});
                       }),
                       "metrics.jsonl"));
}

}  // namespace
}  // namespace tessera
