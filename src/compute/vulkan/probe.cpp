#include "compute/vulkan/probe.h"

#include <algorithm>
#include <bit>
#include <chrono>

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_probe.h"
#include "shaders/probe_flops.h"
#include "shaders/probe_gather.h"
#include "shaders/probe_stream.h"

namespace tessera {
namespace {

constexpr uint32_t kThreads = 256;     // of a workgroup
constexpr double kWorkSeconds = 0.01;  // that a measurement takes at least: what it costs to begin one is nothing then
constexpr uint32_t kMostRounds = 1 << 14;

class VulkanProbe final : public MachineProbe {
 public:
  explicit VulkanProbe(VulkanDevice& device)
      : device_(device), stream_(std::make_shared<GpuStream>(device.context())), sink_(device.context(), 16) {}

  double flops() override {
    const GpuKernel kernel(device_.context(), kProbeFlopsSpirv);
    constexpr uint32_t kGroups = 1024;
    arguments::ProbeArguments arguments = {};
    arguments.to = sink_.address();
    return rate(kernel, arguments, kGroups, 2.0 * 16 * kThreads * kGroups);
  }

  double gatherRate(size_t bytes, int) override {
    const GpuKernel kernel(device_.context(), kProbeGatherSpirv);
    const size_t table = std::bit_floor(std::max<size_t>(bytes, 64));
    const GpuBuffer entries = zeroed(table);
    constexpr uint32_t kGroups = 1024;
    arguments::ProbeArguments arguments = {};
    arguments.from = entries.address();
    arguments.to = sink_.address();
    arguments.count = static_cast<uint32_t>(table / 8);
    const double found = rate(kernel, arguments, kGroups, 8.0 * kThreads * kGroups);
    stream_->finish();
    return found;
  }

  double streamRate(size_t bytes) override {
    const GpuKernel kernel(device_.context(), kProbeStreamSpirv);
    const size_t half = std::max<size_t>(bytes / 2 / 16 * 16, 16);
    GpuBuffer from = zeroed(half), to = zeroed(half);
    arguments::ProbeArguments arguments = {};
    arguments.from = from.address();
    arguments.to = to.address();
    arguments.count = static_cast<uint32_t>(half / 16);
    const size_t most = device_.context()->limits().maxComputeWorkGroupCount[0];
    const auto groups = static_cast<uint32_t>(std::min<size_t>((arguments.count + kThreads - 1) / kThreads, most));
    const double found = rate(kernel, arguments, groups, 2.0 * static_cast<double>(half));
    stream_->finish();
    return found;
  }

 private:
  GpuBuffer zeroed(size_t bytes) {
    GpuBuffer buffer(device_.context(), bytes);
    stream_->fillZero(buffer, 0, bytes);
    stream_->finish();
    return buffer;
  }

  double seconds(const GpuKernel& kernel, const arguments::ProbeArguments& arguments, uint32_t groups) {
    const auto begun = std::chrono::steady_clock::now();
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), {groups});
    stream_->finish();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  }

  // `amount`: of a round.
  double rate(const GpuKernel& kernel, arguments::ProbeArguments arguments, uint32_t groups, double amount) {
    arguments.rounds = 2;
    while (arguments.rounds < kMostRounds && seconds(kernel, arguments, groups) < kWorkSeconds) arguments.rounds *= 2;
    double best = 1e30;
    for (int i = 0; i < 4; ++i) best = std::min(best, seconds(kernel, arguments, groups));
    return amount * arguments.rounds / best;
  }

  VulkanDevice& device_;
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer sink_;
};

}  // namespace

std::unique_ptr<MachineProbe> makeVulkanProbe(Device& device) {
  return std::make_unique<VulkanProbe>(dynamic_cast<VulkanDevice&>(device));
}

}  // namespace tessera
