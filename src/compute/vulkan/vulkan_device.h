// The implementation of Device with a GpuStream: every operation copies its arguments, queues its kernels and returns.
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "compute/device.h"
#include "compute/vulkan/counted_groups.h"
#include "gpu/stream.h"
#include "shaders/compute/arguments.h"
#include "shaders/compute/arguments_mlp.h"

namespace tessera {

class VulkanMemory : public Memory {
 public:
  VulkanMemory(std::shared_ptr<GpuStream> stream, GpuBuffer buffer, size_t bytes)
      : Memory(bytes), stream_(std::move(stream)), buffer_(std::move(buffer)) {}
  ~VulkanMemory() override { stream_->deferDestroy(std::move(buffer_)); }
  const GpuBuffer& buffer() const { return buffer_; }

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer buffer_;
};

class VulkanDevice : public Device {
 public:
  // The arithmetic of networks. `floats` needs no optional feature. All of them accumulate sums in float.
  enum class MlpArithmetic { floats, halves, nvMatrices, khrMatrices, emulatedMatrices };
  using MlpForms = std::array<std::span<const uint32_t>, 5>;  // SPIR-V of a kernel for each MlpArithmetic

  explicit VulkanDevice(std::shared_ptr<const GpuContext> context);  // with bestArithmetic
  VulkanDevice(std::shared_ptr<const GpuContext> context, MlpArithmetic arithmetic, const GpuMatrices& matrices,
               const GroupBounds& bounds = {});
  ~VulkanDevice() override;  // with TESSERA_GPU_TIMES=1 in the environment, logs the device time of each operation

  // Returns the specialization constants of a kernel that includes matrix_tiles.glsl: its own three, then those of
  // matrix_tiles.glsl.
  static std::vector<uint32_t> matrixConstants(std::vector<uint32_t> own, const GpuMatrices& matrices);

  const std::shared_ptr<const GpuContext>& context() const { return stream_->context(); }
  const GpuStream& stream() const { return *stream_; }

  std::string name() const override;
  std::string target() const override;
  OwnMemory ownMemory() const override;
  std::unique_ptr<Memory> allocate(size_t bytes) override;
  void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) override;
  void readBytes(std::span<const Reading> readings) override;
  void fillZero(Memory& memory, size_t offset, size_t bytes) override;
  void finish() override;
  static MlpArithmetic bestArithmetic(const GpuContext& context);
  bool multipliesMatrices() const { return mlpArithmetic_ >= MlpArithmetic::nvMatrices; }
  // Row counts of operations that begin at row 0, and of those that work on a part of the rows.
  arguments::CountArguments countArguments(const Count& count) const;
  arguments::CountArguments partArguments(const Count& count) const;

  bool storesActivationsInHalf() const override { return mlpArithmetic_ != MlpArithmetic::floats; }

  using Device::fillZero;

 private:
  bool runOperation(const OperationId& operation, const void* arguments) override;
  // Specialised for every operation in the source file of its kind; device.cpp declares all specialisations.
  template <class Arguments>
  void enqueue(const Arguments& options);

  // Returns a kernel, compiled at first use. `constants` are the shader's specialization constants in order.
  const GpuKernel& kernel(std::span<const uint32_t> spirv, std::vector<uint32_t> constants = {},
                          uint32_t subgroupSize = 0);
  // Returns a kernel of networks for the current arithmetic. `constants` are those that all its forms share.
  const GpuKernel& mlpKernel(const MlpForms& forms, std::vector<uint32_t> constants);
  // Returns the result of `make`, which compiles kernels of networks. If the driver rejects kernels with cooperative
  // matrices, `make` is called again and matrices are no longer used.
  template <class Make>
  auto withOrWithoutMatrices(const Make& make);
  struct BlockKernel {
    const GpuKernel& kernel;
    uint32_t samples;  // per workgroup
  };
  BlockKernel blockKernel(const MlpForms& forms, const MlpShape& shape, uint32_t stateWidth);
  // Chooses between the two forms of a kernel with many invocations that add to the same sums.
  const GpuKernel& sumKernel(std::span<const uint32_t> withFloatAtomics, std::span<const uint32_t> without,
                             std::vector<uint32_t> constants = {});
  // Chooses between the two forms of a kernel that computes in double if the device supports it (real.glsl).
  const GpuKernel& realKernel(std::span<const uint32_t> inDouble, std::span<const uint32_t> inFloat,
                              std::vector<uint32_t> constants = {});
  // Chooses between the two forms of a kernel that sums over workgroups (group_sum.glsl).
  std::span<const uint32_t> groupSpirv(std::span<const uint32_t> withSubgroups,
                                       std::span<const uint32_t> without) const {
    return stream_->context()->features().subgroups ? withSubgroups : without;
  }
  arguments::RealArguments realArguments(double value) const;
  // Like realArguments, but never rounds down: for a lower bound that smaller numbers must not reach.
  arguments::RealArguments realArgumentsNotBelow(double value) const;
  template <class Arguments>
  void queue(const GpuKernel& kernel, const Arguments& arguments, Groups groups) {
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), groups);
  }
  // Returns enough workgroups of `perGroup` elements for `count` elements, at most the device's limit: kernels loop
  // over the rest.
  uint32_t groups(size_t count, size_t perGroup) const;
  // The same for `elements` per row of `rows`, whose number the device may have counted, and `y` groups along y. Queues
  // the kernel that counts the groups if necessary.
  Groups countGroups(const Count& rows, uint32_t perGroup, uint32_t elements = 1, uint32_t y = 1) {
    return countedGroups_.of(*stream_, partArguments(rows), static_cast<bool>(rows.counter), elements, perGroup, y);
  }
  // Must be called for every write of numbers that may be counters.
  void countersChanged(const Slice<const uint32_t>& words);
  uint32_t atLeastOneGroup(size_t count, size_t perGroup) const { return std::max(groups(count, perGroup), 1u); }

  // Prefix sums: values[i] = Σ_{j <= i} values[j] for i below `rows`, in place; see ScanArguments. If `marks` is set,
  // values[i] is the number of bits set in the words of `marks` before word i. `scratch` has a capacity of
  // scanScratch(rows.capacity) numbers.
  struct RunningSums {
    Count rows;
    uint64_t values = 0;
    uint64_t total = 0, fitting = 0;  // [1] each
    uint32_t limit = 0;
    uint64_t scratch = 0;
    uint64_t marks = 0;
  };
  static constexpr uint32_t kNoLimit = 0x7ffffffeu;  // so that no two sums overflow
  void queueRunningSums(const RunningSums& sums);
  static size_t scanScratch(size_t rows);
  // Scratch addresses for kernels that first count the samples of each ray and then write them.
  struct RayScratch {
    uint64_t counts = 0, nexts = 0;  // [rays]
    uint64_t fitting = 0;            // [1]
    uint64_t partials = 0;
  };
  RayScratch rayScratch(uint32_t rays);
  // Runs a marching kernel twice: it counts the samples, then writes them. march.h sets the common arguments.
  template <class Options, class Arguments>
  void queueMarch(std::span<const uint32_t> inDouble, std::span<const uint32_t> inFloat, const Options& options,
                  Arguments& arguments);
  void zeroRows(const Count& rows, uint32_t columns, const Slice<float>& numbers);
  void moveRows(const Count& rows, const Slice<const uint32_t>& source, const Matrix<const float>& from,
                const Matrix<const float>& to, bool scatter);
  // Runs a kernel whose workgroups write `columns` partial sums each to arguments.partials, and adds these up.
  template <class Arguments>
  void queueSums(const GpuKernel& kernel, Arguments& arguments, uint32_t groups, uint32_t columns, uint64_t sums) {
    arguments.partials = scratch(size_t{groups} * columns);
    queue(kernel, arguments, {groups});
    addPartials(arguments.partials, groups, columns, sums);
  }
  template <class Arguments, class Options>
  Arguments lookupArguments(const Options& options) const;  // of virtual grids and lattices
  void addPartials(uint64_t partials, uint32_t count, uint32_t columns, uint64_t sums);
  // Returns the address of at least `floats` floats of scratch memory for use within one operation.
  uint64_t scratch(size_t floats);
  // Returns the address of the network's weights for its kernels: the weights themselves, or copies in fp16 at
  // `scratch`.
  uint64_t weightNumbers(const Slice<const float>& weights, uint64_t scratch);
  void queueWeightGradients(const arguments::MlpWeightGradientsArguments& sums, size_t capacity);

  std::shared_ptr<GpuStream> stream_;
  // [2]: 0 and the largest uint32_t, the counters of operations without counters. Kernels read it instead of a null
  // address: Mesa's driver for the CPU (26.2) reads such words even in branches that no invocation takes.
  GpuBuffer noCounter_;
  CountedGroups countedGroups_;
  MlpArithmetic mlpArithmetic_;
  GpuMatrices matrices_;
  std::map<std::pair<const uint32_t*, std::vector<uint32_t>>, GpuKernel> kernels_;
  GpuBuffer scratch_;
};

// Returns the device address of a slice; 0 for an empty one.
template <class T>
uint64_t deviceAddress(const Slice<T>& slice) {
  if (!slice) return 0;
  return static_cast<const VulkanMemory*>(slice.memory)->buffer().address() + slice.first * sizeof(T);
}

// Returns the device address of a slice that kernels read as vec4; CHECKs that it is a multiple of 16.
inline uint64_t quadAddress(const Slice<const float>& slice) {
  const uint64_t address = deviceAddress(slice);
  CHECK(address % 16 == 0u);
  return address;
}

// Throws Error if the 32-bit indices of kernels do not reach all numbers of an operand. Settings decide on these sizes.
void requireIndexable(size_t numbers);

// Converts a matrix to kernel arguments. Throws Error if a kernel's indices do not reach the last of `rows` rows.
arguments::MatrixArguments matrixArguments(const Matrix<const float>& matrix, size_t rows);

}  // namespace tessera
