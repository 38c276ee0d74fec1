#include "compute/roofline.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <map>

#include "base/random.h"
#include "base/threads.h"
#include "compute/cpu/kernels.h"
#include "compute/hash_grid.h"
#include "compute/roofline_recorder.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "compute/vulkan/probe.h"
#endif

namespace tessera {
namespace {

class CpuProbe final : public MachineProbe {
 public:
  explicit CpuProbe(int threads) : pool_(threads) {}
  double flops() override { return cpu::peakFlops(pool_); }
  double gatherRate(size_t bytes, int tables) override { return cpu::gatherRate(pool_, bytes, tables); }
  double streamRate(size_t bytes) override { return cpu::streamRate(pool_, bytes); }

 private:
  ThreadPool pool_;
};

// Whether the device queues operations instead of running them at once.
bool isQueued([[maybe_unused]] const Device& device) {
#ifdef TESSERA_HAS_VULKAN
  return vulkanContext(device) != nullptr;
#else
  return false;
#endif
}

// Returns null for the reference device, which is not optimised for speed.
std::unique_ptr<MachineProbe> makeMachineProbe([[maybe_unused]] Device& device, const DeviceOptions& options) {
#ifdef TESSERA_HAS_VULKAN
  if (vulkanContext(device)) return makeVulkanProbe(device);
#endif
  return options.kind == "reference" ? nullptr : std::make_unique<CpuProbe>(options.threads);
}

MachineLimits measureLimits(MachineProbe& probe, const HashGrid& grid) {
  MachineLimits limits;
  limits.flops = probe.flops();
  limits.matrixFlops = probe.matrixFlops();
  std::map<size_t, int> tables;
  for (const HashGridLevel& level : grid.levels) ++tables[size_t{level.entries} * grid.features * sizeof(float)];
  for (const auto& [bytes, count] : tables) limits.gathers.push_back({bytes, probe.gatherRate(bytes, count)});
  return limits;
}

// Keeps the higher of two measurements: a limit measured while the machine is disturbed would inflate every share.
void raise(MachineLimits& limits, const MachineLimits& again) {
  limits.flops = std::max(limits.flops, again.flops);
  limits.matrixFlops = std::max(limits.matrixFlops, again.matrixFlops);
  for (size_t i = 0; i < limits.gathers.size(); ++i) {
    limits.gathers[i].lookups = std::max(limits.gathers[i].lookups, again.gathers[i].lookups);
  }
}

}  // namespace

void RooflineRecorder::measure(const OperationId& operation, Work work, const std::function<void()>& run) {
  using Clock = std::chrono::steady_clock;
  // Each measurement repeats the run so often that the cost of starting and waiting is negligible.
  int times = 1;
  const auto timed = [&] {
    const auto start = Clock::now();
    for (int i = 0; i < times; ++i) run();
    device_.finish();
    return std::chrono::duration<double>(Clock::now() - start).count();
  };
  timed();
  constexpr double kMinSeconds = 1e-2;
  constexpr int kMaxTimes = 1024;
  while (isQueued_ && times < kMaxTimes && timed() < kMinSeconds) times *= 2;
  double best = 1e30, spent = 0;
  for (int i = 0; i < 3 || spent < options_.secondsPerRow; ++i) {
    const double seconds = timed();
    best = std::min(best, seconds / times);
    spent += seconds;
  }
  rows_.push_back({operation, std::move(work.name), std::move(work.shape), best, work.amount / best,
                   std::move(work.unit), work.limit, work.memoryLimit});
}

void RooflineRecorder::measureStream(const OperationId& operation, std::string shape, double bytes,
                                     const std::function<void()>& run) {
  const std::string name(operation.name());
  measure(operation, {name, std::move(shape), bytes, "B", streamLimit(bytes)}, run);
}

double RooflineRecorder::streamLimit(double bytes) {
  if (!probe_) return 0;
  const size_t footprint = std::clamp(std::bit_ceil(static_cast<size_t>(bytes)), size_t{1} << 16, size_t{1} << 29);
  const auto place = std::lower_bound(limits_.streams.begin(), limits_.streams.end(), footprint,
                                      [](const MachineLimits::Stream& a, size_t b) { return a.bytes < b; });
  if (place != limits_.streams.end() && place->bytes == footprint) return place->rate;
  const double rate = std::max(probe_->streamRate(footprint), probe_->streamRate(footprint));
  limits_.streams.insert(place, {footprint, rate});
  return rate;
}

double RooflineRecorder::gatherLimit(size_t bytes) {
  if (!probe_) return 0;
  const size_t table = std::clamp(std::bit_ceil(bytes), size_t{1} << 14, size_t{1} << 28);
  for (const MachineLimits::Gather& gather : limits_.gathers) {
    if (gather.tableBytes == table) return gather.lookups;
  }
  const double rate = std::max(probe_->gatherRate(table, 1), probe_->gatherRate(table, 1));
  limits_.gathers.push_back({table, rate});
  return rate;
}

Array<float> RooflineRecorder::randomFloats(size_t count, float low, float high) {
  const RandomStream random(1, ++arrays_);
  std::vector<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = low + (high - low) * random.uniform(i);
  return device_.uploadArray(values);
}

std::vector<float> rayLikePositions(uint32_t rays, uint32_t perRay, uint64_t seed) {
  constexpr float kStep = 1.7320508f / 1024;  // the minimum step of instant-ngp in a unit cube
  const RandomStream random(seed, 0x4a9);
  std::vector<float> positions;
  positions.reserve(size_t{rays} * perRay * 3);
  for (uint32_t ray = 0; ray < rays; ++ray) {
    float origin[3], direction[3];
    const float z = 2 * random.uniform(8 * ray) - 1, around = 6.2831853f * random.uniform(8 * ray + 1);
    const float r = std::sqrt(1 - z * z);
    direction[0] = r * std::cos(around);
    direction[1] = r * std::sin(around);
    direction[2] = z;
    for (int axis = 0; axis < 3; ++axis) origin[axis] = random.uniform(8 * ray + 2 + axis);
    for (uint32_t i = 0; i < perRay; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        positions.push_back(std::clamp(origin[axis] + direction[axis] * kStep * static_cast<float>(i), 0.0f, 1.0f));
      }
    }
  }
  return positions;
}

Roofline measureRoofline(const RooflineOptions& options) {
  const std::unique_ptr<Device> device = makeDevice(options.device);
  const HashGrid grid;  // the default one: 16 levels of two features, at most 2^17 entries
  const std::unique_ptr<MachineProbe> probe = makeMachineProbe(*device, options.device);
  Roofline result;
  result.device = device->name();
  if (probe) {
    result.limits = measureLimits(*probe, grid);
    raise(result.limits, measureLimits(*probe, grid));
  }
  RooflineRecorder recorder(*device, isQueued(*device), probe.get(), options, result.limits);
  measureNetworks(recorder);
  measureHashGrids(recorder, grid);
  measureSampleStreams(recorder);
  measureBlockStreams(recorder);
  measureVirtualGrid(recorder);
  measureAttention(recorder);
  measureOctahedra(recorder);
  measurePatches(recorder);
  measureParameterStreams(recorder);
  result.rows = recorder.takeRows();
  return result;
}

}  // namespace tessera
