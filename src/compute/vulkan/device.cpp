#include "compute/vulkan/device.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string_view>

#include "base/error.h"
#include "base/log.h"
#include "compute/operations.h"
#include "compute/vulkan/vulkan_device.h"
#include "gpu/heap.h"

namespace tessera {

#define TESSERA_ENQUEUE(name) \
  template <>                 \
  void VulkanDevice::enqueue(const name& options);
TESSERA_OPERATIONS(TESSERA_ENQUEUE)
#undef TESSERA_ENQUEUE

namespace {

constexpr GroupBounds kFewGroups = {.minimum = 1, .maximum = 3};

}  // namespace

std::unique_ptr<Device> makeVulkanDevice() {
  return makeVulkanDevice(GpuOptions());
}

std::unique_ptr<Device> makeVulkanDevice(const GpuOptions& options) {
  return std::make_unique<VulkanDevice>(GpuContext::open(options));
}

std::unique_ptr<Device> makeVulkanDeviceWithEmulatedMatrices(const GpuOptions& options, const GpuMatrices& matrices) {
  auto context = GpuContext::open(options);
  CHECK(context->features().float16);
  // Mesa 22's driver for the CPU confuses the tiles of different invocations when a workgroup loops over more samples.
  const bool mixesUp = context->name().find("Mesa 22.") != std::string::npos;
  return std::make_unique<VulkanDevice>(std::move(context), VulkanDevice::MlpArithmetic::emulatedMatrices, matrices,
                                        mixesUp ? GroupBounds() : kFewGroups);
}

std::unique_ptr<Device> makeVulkanDeviceWithFewGroups(const GpuOptions& options) {
  auto context = GpuContext::open(options);
  return std::make_unique<VulkanDevice>(context, VulkanDevice::bestArithmetic(*context), context->matrices(),
                                        kFewGroups);
}

std::shared_ptr<const GpuContext> vulkanContext(const Device& device) {
  const auto* const vulkan = dynamic_cast<const VulkanDevice*>(&device);
  return vulkan == nullptr ? nullptr : vulkan->context();
}

VulkanBatches countBatches(const Device& device) {
  const GpuStream& stream = dynamic_cast<const VulkanDevice&>(device).stream();
  return {stream.batchesSent(), stream.batchesRecorded()};
}

VulkanDevice::VulkanDevice(std::shared_ptr<const GpuContext> context)
    : VulkanDevice(context, bestArithmetic(*context), context->matrices()) {}

VulkanDevice::VulkanDevice(std::shared_ptr<const GpuContext> context, MlpArithmetic arithmetic,
                           const GpuMatrices& matrices, const GroupBounds& bounds)
    : stream_(std::make_shared<GpuStream>(context)),
      noCounter_(context, 2 * sizeof(uint32_t)),
      countedGroups_(context, bounds),
      mlpArithmetic_(arithmetic),
      matrices_(matrices) {
  const uint32_t words[] = {0, ~0u};
  stream_->upload(noCounter_, 0, std::as_bytes(std::span(words)));
  const char* times = std::getenv("TESSERA_GPU_TIMES");
  if (times != nullptr && std::string_view(times) == "1") stream_->measure(true);
}

VulkanDevice::MlpArithmetic VulkanDevice::bestArithmetic(const GpuContext& context) {
  if (context.matrices().kind == GpuMatrices::Kind::khr) return MlpArithmetic::khrMatrices;
  if (context.matrices().kind == GpuMatrices::Kind::nv) return MlpArithmetic::nvMatrices;
  return context.features().float16 ? MlpArithmetic::halves : MlpArithmetic::floats;
}

VulkanDevice::~VulkanDevice() {
  stream_->context()->waitIdle();  // even after errors: kernels and memory are destroyed next
  if (!stream_->isMeasuring()) return;
  try {
    double all = 0;
    for (const auto& [name, measured] : stream_->measured()) all += measured.seconds;
    for (const auto& [name, measured] : stream_->measured()) {
      inform("{:<26} {:10.3f} ms in {} commands, {:.1f} %", name, 1e3 * measured.seconds, measured.commands,
             100 * measured.seconds / all);
    }
  } catch (const std::exception&) {  // a lost device has no times, and its error has been reported
  }
}

std::string VulkanDevice::name() const {
  return "vulkan " + stream_->context()->name();
}
std::string VulkanDevice::target() const {
  return stream_->context()->target();
}

Device::OwnMemory VulkanDevice::ownMemory() const {
  const GpuContext& context = *stream_->context();
  if (!context.isDiscrete()) return {};
  return {context.memoryBytes(), context.heap().bytesInUse()};
}

std::unique_ptr<Memory> VulkanDevice::allocate(size_t bytes) {
  auto memory = std::make_unique<VulkanMemory>(stream_, stream_->makeBuffer(bytes), bytes);
  stream_->label("fills");
  const size_t filled = (bytes + 3) / 4 * 4;
  stream_->fillZero(memory->buffer(), 0, filled);
  countedGroups_.changed(memory->buffer().address(), filled);
  return memory;
}

void VulkanDevice::writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) {
  stream_->label("copies");
  const GpuBuffer& buffer = static_cast<VulkanMemory&>(to).buffer();
  stream_->upload(buffer, offset, from);
  countedGroups_.changed(buffer.address() + offset, from.size());
}

void VulkanDevice::readBytes(std::span<const Reading> readings) {
  stream_->label("copies");
  std::vector<GpuStream::Download> downloads;
  for (const Reading& reading : readings) {
    downloads.push_back({&static_cast<const VulkanMemory*>(reading.from)->buffer(), reading.offset, reading.to});
  }
  stream_->download(downloads);
}

void VulkanDevice::fillZero(Memory& memory, size_t offset, size_t bytes) {
  CHECK(offset + bytes <= memory.bytes());
  stream_->label("fills");
  const GpuBuffer& buffer = static_cast<VulkanMemory&>(memory).buffer();
  stream_->fillZero(buffer, offset, bytes);
  countedGroups_.changed(buffer.address() + offset, bytes);
}

void VulkanDevice::finish() {
  stream_->finish();
}

bool VulkanDevice::runOperation(const OperationId& operation, const void* arguments) {
  stream_->label(operation.name());
  return dispatchOperation(operation, arguments, [this](const auto& options) { enqueue(options); });
}

const GpuKernel& VulkanDevice::kernel(std::span<const uint32_t> spirv, std::vector<uint32_t> constants,
                                      uint32_t subgroupSize) {
  const auto key = std::make_pair(spirv.data(), std::move(constants));
  const auto it = kernels_.find(key);
  if (it != kernels_.end()) return it->second;
  return kernels_.try_emplace(key, stream_->context(), spirv, key.second, subgroupSize).first->second;
}

const GpuKernel& VulkanDevice::sumKernel(std::span<const uint32_t> withFloatAtomics, std::span<const uint32_t> without,
                                         std::vector<uint32_t> constants) {
  return kernel(stream_->context()->features().floatAtomics ? withFloatAtomics : without, std::move(constants));
}

const GpuKernel& VulkanDevice::realKernel(std::span<const uint32_t> inDouble, std::span<const uint32_t> inFloat,
                                          std::vector<uint32_t> constants) {
  return kernel(stream_->context()->features().float64 ? inDouble : inFloat, std::move(constants));
}

arguments::RealArguments VulkanDevice::realArguments(double value) const {
  if (!stream_->context()->features().float64) return {std::bit_cast<uint32_t>(static_cast<float>(value)), 0};
  const auto bits = std::bit_cast<uint64_t>(value);
  return {static_cast<uint32_t>(bits), static_cast<uint32_t>(bits >> 32)};
}

arguments::RealArguments VulkanDevice::realArgumentsNotBelow(double value) const {
  const auto rounded = static_cast<float>(value);
  if (stream_->context()->features().float64 || rounded >= value) return realArguments(value);
  return realArguments(std::nextafter(rounded, std::numeric_limits<float>::infinity()));
}

uint32_t VulkanDevice::groups(size_t count, size_t perGroup) const {
  return workgroups(count, perGroup, stream_->context()->limits().maxComputeWorkGroupCount[0]);
}

void VulkanDevice::countersChanged(const Slice<const uint32_t>& words) {
  if (words) countedGroups_.changed(deviceAddress(words), words.count * sizeof(uint32_t));
}

uint64_t VulkanDevice::scratch(size_t floats) {
  const size_t bytes = floats * sizeof(float);
  if (scratch_.bytes() < bytes) {
    stream_->deferDestroy(std::move(scratch_));
    scratch_ = GpuBuffer();
    scratch_ = stream_->makeBuffer(bytes);
  }
  return scratch_.address();
}

arguments::CountArguments VulkanDevice::countArguments(const Count& count) const {
  CHECK(!count.first);
  return partArguments(count);
}

arguments::CountArguments VulkanDevice::partArguments(const Count& count) const {
  return {count.counter ? deviceAddress(count.counter) : noCounter_.address() + sizeof(uint32_t),
          count.first ? deviceAddress(count.first) : noCounter_.address(), count.capacity, 0};
}

void requireIndexable(size_t numbers) {
  if (numbers < size_t{1} << 31) return;
  throw Error(
      "vulkan", "", fmt::format("an operation has {} numbers, and indices on this device end at 2^31", numbers),
      "lower samples_per_step, texels_per_step, max_rays or the sizes of networks and tables, or use --device cpu");
}

arguments::MatrixArguments matrixArguments(const Matrix<const float>& matrix, size_t rows) {
  if (!matrix) return {};
  requireIndexable(matrix.groupStride);
  if (rows > 0 && matrix.columns > 0) requireIndexable(matrix.offset(rows - 1, matrix.columns - 1));
  return {deviceAddress(matrix.data), matrix.columns, matrix.rowStride, matrix.groupWidth,
          static_cast<uint32_t>(matrix.groupStride)};
}

}  // namespace tessera
