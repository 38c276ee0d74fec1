// For tests: the same training on the CPU, on Vulkan, and started on one and finished on the other.
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
// While an object exists, submissions fail as if the GPU were lost.
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

// While an object exists, allocations fail as if the GPU were out of memory.
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

  // Trains or resumes the model in a folder.
  std::function<void(Device& device, const fs::path& folder, const TrainingLoopOptions& loop)> train;
  // Renders an image of that model.
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

  // The devices differ only in rounding, which stays small over a few steps.
  void expectTheSamePictures(const fs::path& scratch) const {
#ifndef TESSERA_HAS_VULKAN
    GTEST_SKIP() << "this build has no Vulkan";
#else
    SKIP_WITHOUT_VULKAN(openForTest());
    const std::unique_ptr<Device> cpu = makeDevice({"cpu", 2}), vulkan = makeDevice({"vulkan"});
    trainOn(*cpu, scratch / "cpu", false);
    const ImageF expected = draw(*cpu, scratch / "cpu");
    trainOn(*vulkan, scratch / "vulkan", false);
    trainOn(*vulkan, scratch / "to-cpu", false, kSteps / 2);
    trainOn(*cpu, scratch / "to-cpu", true);
    trainOn(*cpu, scratch / "to-vulkan", false, kSteps / 2);
    trainOn(*vulkan, scratch / "to-vulkan", true);
    for (const char* folder : {"vulkan", "to-cpu", "to-vulkan"}) {
      EXPECT_GT(decibels(draw(*cpu, scratch / folder), expected), 40) << folder;
    }
    EXPECT_GT(decibels(draw(*vulkan, scratch / "cpu"), expected), 50) << "drawn on Vulkan";
    // GPUs without doubles compute the positions of samples in floats.
    GpuOptions floats;
    floats.allowed.float64 = false;
    const std::unique_ptr<Device> single = makeVulkanDevice(floats);
    trainOn(*single, scratch / "floats", false);
    EXPECT_GT(decibels(draw(*cpu, scratch / "floats"), expected), 35) << "without doubles";
    EXPECT_GT(decibels(draw(*single, scratch / "cpu"), expected), 35) << "drawn without doubles";
    EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
  }

  // A failure gives one clear error, and the CPU can resume from the last checkpoint.
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

// Expects that a step reads nothing back before its end and rarely records its commands again, whatever its number of
// rays. `trainable` must have been created on the Vulkan device.
inline void expectOneBatchAStep([[maybe_unused]] Device& vulkan, [[maybe_unused]] TrainableModel& trainable) {
#ifdef TESSERA_HAS_VULKAN
  constexpr int64_t kFirst = 7, kEnd = 15;  // between two updates of the occupancy
  std::set<uint32_t> rays;
  VulkanBatches before;
  for (int64_t step = 0; step < kEnd; ++step) {
    if (step == kFirst) before = countBatches(vulkan);
    const StepReport report = trainable.step(step, 100);
    if (step >= kFirst) rays.insert(report.rays);
  }
  const VulkanBatches after = countBatches(vulkan);
  EXPECT_EQ(after.sent - before.sent, static_cast<uint64_t>(kEnd - kFirst));
  EXPECT_LE(after.recorded - before.recorded, static_cast<uint64_t>(kEnd - kFirst) - 2);
  EXPECT_GT(rays.size(), 1u);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
}

}  // namespace tessera
