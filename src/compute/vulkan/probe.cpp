#include "compute/vulkan/probe.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <functional>

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_probe.h"
#include "shaders/probe_flops.h"
#include "shaders/probe_gather.h"
#include "shaders/probe_matrices_nv.h"
#include "shaders/probe_stream.h"
#ifdef TESSERA_KHR_MATRICES
#include "shaders/probe_matrices_khr.h"
#endif

namespace tessera {
namespace {

constexpr uint32_t kThreads = 256;     // per workgroup
constexpr double kWorkSeconds = 0.01;  // minimum duration of a measurement, so that launch overhead is negligible
constexpr uint32_t kMaxRounds = 1 << 18, kMaxCopies = 512;

class VulkanProbe final : public MachineProbe {
 public:
  explicit VulkanProbe(VulkanDevice& device)
      : context_(device.context()),
        multiplyAdds_(context_, kProbeFlopsSpirv),
        gather_(context_, kProbeGatherSpirv),
        copy_(context_, kProbeStreamSpirv),
        sink_(context_, 16),
        stream_(context_) {
    const GpuMatrices& matrices = context_->matrices();
    std::span<const uint32_t> spirv;
    if (!device.multipliesMatrices()) return;
    if (matrices.kind == GpuMatrices::Kind::nv) spirv = kProbeMatricesNvSpirv;
#ifdef TESSERA_KHR_MATRICES
    if (matrices.kind == GpuMatrices::Kind::khr) spirv = kProbeMatricesKhrSpirv;
#endif
    if (spirv.empty()) return;
    try {
      matrices_ = std::make_unique<GpuKernel>(context_, spirv, VulkanDevice::matrixConstants({}, matrices),
                                              matrices.subgroupSize);
    } catch (const KernelRefused&) {  // networks do not use them either
    }
  }

  double flops() override {
    constexpr uint32_t kGroups = 8192;
    arguments::ProbeArguments arguments = {};
    arguments.to = sink_.address();
    const auto run = [&](uint32_t rounds) {
      arguments.rounds = rounds;
      queue(multiplyAdds_, arguments, kGroups);
    };
    return rate(run, kMaxRounds, 2.0 * 16 * kThreads * kGroups);
  }

  double matrixFlops() override {
    if (!matrices_) return 0;
    constexpr uint32_t kGroups = 8192;
    const GpuMatrices& shape = context_->matrices();
    arguments::ProbeArguments arguments = {};
    arguments.to = sink_.address();
    const auto run = [&](uint32_t rounds) {
      arguments.rounds = rounds;
      queue(*matrices_, arguments, kGroups);
    };
    constexpr double kSums = 4;  // probe_matrices.comp
    return rate(run, kMaxRounds,
                2.0 * shape.rows * shape.columns * shape.depth * kSums * GpuMatrices::kSubgroups * kGroups);
  }

  double gatherRate(size_t bytes, int) override {
    const size_t table = std::bit_floor(std::max<size_t>(bytes, 64));
    GpuBuffer entries = zeroed(table);
    constexpr uint32_t kGroups = 1024;
    arguments::ProbeArguments arguments = {};
    arguments.from = entries.address();
    arguments.to = sink_.address();
    arguments.count = static_cast<uint32_t>(table / 8);
    const auto run = [&](uint32_t rounds) {
      arguments.rounds = rounds;
      queue(gather_, arguments, kGroups);
    };
    const double loadsPerSecond = rate(run, kMaxRounds, 8.0 * kThreads * kGroups);
    stream_.deferDestroy(std::move(entries));
    return loadsPerSecond;
  }

  double streamRate(size_t bytes) override {
    const size_t half = std::max<size_t>(bytes / 2 / 16 * 16, 16);
    GpuBuffer one = zeroed(half), other = zeroed(half);
    arguments::ProbeArguments there = {};
    there.from = one.address();
    there.to = other.address();
    there.count = static_cast<uint32_t>(half / 16);
    arguments::ProbeArguments back = there;
    std::swap(back.from, back.to);
    const size_t maximum = context_->limits().maxComputeWorkGroupCount[0];
    const auto groups = static_cast<uint32_t>(std::min<size_t>((there.count + kThreads - 1) / kThreads, maximum));
    // Each copy begins after the previous one has ended.
    const auto run = [&](uint32_t copies) {
      for (uint32_t i = 0; i < copies; ++i) queue(copy_, i % 2 == 0 ? there : back, groups);
    };
    const double bytesPerSecond = rate(run, kMaxCopies, 2.0 * static_cast<double>(half));
    stream_.deferDestroy(std::move(one));
    stream_.deferDestroy(std::move(other));
    return bytesPerSecond;
  }

 private:
  GpuBuffer zeroed(size_t bytes) {
    GpuBuffer buffer(context_, bytes);
    stream_.fillZero(buffer, 0, bytes);
    stream_.finish();
    return buffer;
  }

  void queue(const GpuKernel& kernel, const arguments::ProbeArguments& arguments, uint32_t groups) {
    stream_.run(kernel, std::as_bytes(std::span(&arguments, 1)), {groups});
  }

  // Returns the amount per second. `run` queues the given number of rounds, each of which processes `amount`.
  double rate(const std::function<void(uint32_t rounds)>& run, uint32_t maxRounds, double amount) {
    uint32_t rounds = 2;
    const auto seconds = [&] {
      const auto begun = std::chrono::steady_clock::now();
      run(rounds);
      stream_.finish();
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    };
    while (seconds() < kWorkSeconds && rounds < maxRounds) rounds *= 2;
    double best = 1e30;
    for (int i = 0; i < 4; ++i) best = std::min(best, seconds());
    return amount * rounds / best;
  }

  std::shared_ptr<const GpuContext> context_;
  GpuKernel multiplyAdds_, gather_, copy_;
  std::unique_ptr<GpuKernel> matrices_;  // null if the device has no cooperative matrices
  GpuBuffer sink_;
  GpuStream stream_;  // destroyed first, which waits for the device
};

}  // namespace

std::unique_ptr<MachineProbe> makeVulkanProbe(Device& device) {
  return std::make_unique<VulkanProbe>(dynamic_cast<VulkanDevice&>(device));
}

}  // namespace tessera
