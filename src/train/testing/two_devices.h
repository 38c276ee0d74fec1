// For tests: the same training on the processor, on Vulkan, and begun on the one and ended on the other.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <string>

#include "base/error.h"
#include "base/image.h"
#include "compute/device.h"
#include "train/model_folder.h"
#include "train/training_loop.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "gpu/testing/test_context.h"
#endif

namespace tessera {

#ifdef TESSERA_HAS_VULKAN
// While it is there, what a driver says whose card has failed.
class LostDevice {
 public:
  LostDevice() : kept_(vkQueueSubmit) {
    vkQueueSubmit = [](VkQueue, uint32_t, const VkSubmitInfo*, VkFence) { return VK_ERROR_DEVICE_LOST; };
  }
  ~LostDevice() { vkQueueSubmit = kept_; }
  LostDevice(const LostDevice&) = delete;
  LostDevice& operator=(const LostDevice&) = delete;

 private:
  PFN_vkQueueSubmit kept_;
};

// Likewise, one whose memory others have taken.
class NoMemory {
 public:
  NoMemory() : kept_(vkAllocateMemory) {
    vkAllocateMemory = [](VkDevice, const VkMemoryAllocateInfo*, const VkAllocationCallbacks*, VkDeviceMemory*) {
      return VK_ERROR_OUT_OF_DEVICE_MEMORY;
    };
  }
  ~NoMemory() { vkAllocateMemory = kept_; }
  NoMemory(const NoMemory&) = delete;
  NoMemory& operator=(const NoMemory&) = delete;

 private:
  PFN_vkAllocateMemory kept_;
};
#endif

struct TwoDevices {
  static constexpr int64_t kSteps = 8;

  // Trains, or goes on with, the model in a folder.
  std::function<void(Device& device, const fs::path& folder, const TrainingLoopOptions& loop)> train;
  // A picture of that model.
  std::function<ImageF(Device& device, const fs::path& folder)> draw;

  void trainOn(Device& device, const fs::path& folder, bool resume, int64_t stopAfter = kSteps) const {
    TrainingLoopOptions loop;
    loop.steps = kSteps;
    loop.resume = resume;
    loop.progress = false;
    int64_t asked = 0;
    loop.stopRequested = [&] { return asked++ >= stopAfter; };
    train(device, folder, loop);
  }

  // Steps differ in rounding alone, which a few of them do not blow up to much.
  void expectTheSamePictures(const fs::path& scratch) const {
#ifndef TESSERA_HAS_VULKAN
    GTEST_SKIP() << "this build has no Vulkan";
#else
    SKIP_WITHOUT_VULKAN(openForTest());
    const std::unique_ptr<Device> cpu = makeDevice({"cpu", 2}), vulkan = makeDevice({"vulkan"});
    trainOn(*cpu, scratch / "cpu", false);
    const ImageF wanted = draw(*cpu, scratch / "cpu");
    trainOn(*vulkan, scratch / "vulkan", false);
    trainOn(*vulkan, scratch / "to-cpu", false, kSteps / 2);
    trainOn(*cpu, scratch / "to-cpu", true);
    trainOn(*cpu, scratch / "to-vulkan", false, kSteps / 2);
    trainOn(*vulkan, scratch / "to-vulkan", true);
    for (const char* folder : {"vulkan", "to-cpu", "to-vulkan"}) {
      EXPECT_GT(decibels(draw(*cpu, scratch / folder), wanted), 40) << folder;
    }
    EXPECT_GT(decibels(draw(*vulkan, scratch / "cpu"), wanted), 50) << "drawn on Vulkan";
    // Cards without doubles decide in floats where samples lie.
    GpuOptions floats;
    floats.allowed.float64 = false;
    const std::unique_ptr<Device> single = makeVulkanDevice(floats);
    trainOn(*single, scratch / "floats", false);
    EXPECT_GT(decibels(draw(*cpu, scratch / "floats"), wanted), 35) << "without doubles";
    EXPECT_GT(decibels(draw(*single, scratch / "cpu"), wanted), 35) << "drawn without doubles";
    EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
  }

  // One clear error, and the processor goes on from the last checkpoint.
  void expectToSurviveFailures(const fs::path& scratch) const {
#ifndef TESSERA_HAS_VULKAN
    GTEST_SKIP() << "this build has no Vulkan";
#else
    SKIP_WITHOUT_VULKAN(openForTest());
    const std::unique_ptr<Device> cpu = makeDevice({"cpu", 2});
    const fs::path folder = scratch / "interrupted";
    trainOn(*cpu, folder, false, kSteps / 2);
    TrainingLoopOptions loop;
    loop.steps = kSteps;
    loop.resume = true;
    loop.progress = false;
    {
      const std::unique_ptr<Device> vulkan = makeDevice({"vulkan"});
      const NoMemory none;
      expectFailure(*vulkan, folder, loop, "out of device memory", "--device cpu");
    }
    {
      const std::unique_ptr<Device> vulkan = makeDevice({"vulkan"});
      std::optional<LostDevice> lost;
      loop.stopRequested = [&, asked = 0]() mutable {
        if (++asked == 2) lost.emplace();
        return false;
      };
      expectFailure(*vulkan, folder, loop, "the device stopped answering", "--resume");
    }
    trainOn(*cpu, folder, true);
    trainOn(*cpu, scratch / "unbroken", false);
    EXPECT_EQ(draw(*cpu, folder).pixels, draw(*cpu, scratch / "unbroken").pixels);
#endif
  }

  void expectFailure(Device& device, const fs::path& folder, const TrainingLoopOptions& loop, const std::string& what,
                     const std::string& remedy) const {
    try {
      train(device, folder, loop);
      FAIL() << "trained without " << what;
    } catch (const Error& error) {
      const std::string said = error.what();
      EXPECT_NE(said.find(what), std::string::npos) << said;
      EXPECT_NE(said.find(remedy), std::string::npos) << said;
      EXPECT_EQ(said.find('\n'), std::string::npos) << said;
    }
    EXPECT_EQ(ModelFolder(folder).manifest()->step, kSteps / 2);
  }

  static double decibels(const ImageF& a, const ImageF& b) {
    CHECK(a.pixels.size() == b.pixels.size());
    double squares = 1e-12;
    for (size_t i = 0; i < a.pixels.size(); ++i) squares += std::pow(a.pixels[i] - b.pixels[i], 2);
    return 10 * std::log10(static_cast<double>(a.pixels.size()) / squares);
  }
};

// Nothing is read in the middle of a step, and its commands are recorded seldom, however many rays it has. `trainee` is
// made on a Vulkan device.
inline void expectOneBatchAStep([[maybe_unused]] Device& vulkan, [[maybe_unused]] Trainee& trainee) {
#ifdef TESSERA_HAS_VULKAN
  constexpr int64_t kFirst = 7, kEnd = 15;  // between two looks at what is empty
  std::set<uint32_t> rays;
  VulkanBatches before;
  for (int64_t step = 0; step < kEnd; ++step) {
    if (step == kFirst) before = batchesOf(vulkan);
    const StepReport report = trainee.step(step, 100);
    if (step >= kFirst) rays.insert(report.rays);
  }
  const VulkanBatches after = batchesOf(vulkan);
  EXPECT_EQ(after.sent - before.sent, static_cast<uint64_t>(kEnd - kFirst));
  EXPECT_LE(after.recorded - before.recorded, static_cast<uint64_t>(kEnd - kFirst) - 2);
  EXPECT_GT(rays.size(), 1u);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
}

}  // namespace tessera
