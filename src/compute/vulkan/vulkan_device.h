// Device on a GpuStream: every operation copies its arguments, queues its kernels and returns.
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
  ~VulkanMemory() override { stream_->retire(std::move(buffer_)); }
  const GpuBuffer& buffer() const { return buffer_; }

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer buffer_;
};

class VulkanDevice : public Device {
 public:
  // How networks are computed; floats need no feature. Sums are floats in all of them.
  enum class MlpArithmetic { floats, halves, nvMatrices, khrMatrices, emulatedMatrices };
  using MlpForms = std::array<std::span<const uint32_t>, 5>;  // of a kernel, for each of those

  explicit VulkanDevice(std::shared_ptr<const GpuContext> context);  // as fast as its features allow
  VulkanDevice(std::shared_ptr<const GpuContext> context, MlpArithmetic arithmetic, const GpuMatrices& matrices,
               const GroupBounds& bounds = {});
  ~VulkanDevice() override;  // with TESSERA_GPU_TIMES=1 in the environment, says what each operation took on the device

  // The specialization constants of a kernel that includes matrix_tiles.glsl: its own three, then those of that.
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
  // Of operations that begin at row 0, and of those that take part of the rows.
  arguments::CountArguments countArguments(const Count& count) const;
  arguments::CountArguments partArguments(const Count& count) const;

  bool keepsHalves() const override { return mlpArithmetic_ != MlpArithmetic::floats; }

  using Device::fillZero;

 private:
  bool runOperation(const OperationId& operation, const void* arguments) override;
  // Specialised for every operation, in the file of its kind; device.cpp knows the list.
  template <class Arguments>
  void enqueue(const Arguments& options);

  // Compiled at first use. `constants` are the shader's specialization constants in order.
  const GpuKernel& kernel(std::span<const uint32_t> spirv, std::vector<uint32_t> constants = {},
                          uint32_t subgroupSize = 0);
  // A kernel of networks. `constants` are those that all its forms have.
  const GpuKernel& mlpKernel(const MlpForms& forms, std::vector<uint32_t> constants);
  // What `make` makes of kernels of networks; once more, and from then on without matrices, where the driver compiles
  // none of theirs.
  template <class Make>
  auto withOrWithoutMatrices(const Make& make);
  struct BlockKernel {
    const GpuKernel& kernel;
    uint32_t samples;  // of a workgroup
  };
  BlockKernel blockKernel(const MlpForms& forms, const MlpShape& shape, uint32_t stateWidth);
  // Chooses between the two forms of a kernel that adds to sums from many invocations.
  const GpuKernel& sumKernel(std::span<const uint32_t> withFloatAtomics, std::span<const uint32_t> without,
                             std::vector<uint32_t> constants = {});
  // And of one that reckons in double where it can (real.glsl).
  const GpuKernel& realKernel(std::span<const uint32_t> inDouble, std::span<const uint32_t> inFloat,
                              std::vector<uint32_t> constants = {});
  // And of one that sums over workgroups (group_sum.glsl).
  std::span<const uint32_t> groupSpirv(std::span<const uint32_t> withSubgroups,
                                       std::span<const uint32_t> without) const {
    return stream_->context()->features().subgroups ? withSubgroups : without;
  }
  arguments::RealArguments realArguments(double value) const;
  // Of a bound that a number just below it must not meet.
  arguments::RealArguments realArgumentsNotBelow(double value) const;
  template <class Arguments>
  void queue(const GpuKernel& kernel, const Arguments& arguments, Groups groups) {
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), groups);
  }
  // Enough workgroups of `perGroup` for `count`, or the most there may be: kernels share out what is left.
  uint32_t groups(size_t count, size_t perGroup) const;
  // The same for `elements` of each of `rows`, of which the device may count fewer than there is room for; times `y`.
  // Queues that counting where need be.
  Groups groupsOf(const Count& rows, uint32_t perGroup, uint32_t elements = 1, uint32_t y = 1) {
    return countedGroups_.of(*stream_, partArguments(rows), static_cast<bool>(rows.counter), elements, perGroup, y);
  }
  // Whatever writes numbers that may be counters says so.
  void countersChanged(const Slice<const uint32_t>& words);
  uint32_t atLeastOneGroup(size_t count, size_t perGroup) const { return std::max(groups(count, perGroup), 1u); }

  // values[i] = Σ_{j <= i} values[j] for i below `rows`, in place; see ScanArguments. With `marks`, what is summed are
  // the bits of those words, and of all words before each. `scratch` has room for scanScratch(rows.capacity) numbers.
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
  // What kernels need that first count a ray's samples and then write them.
  struct RayScratch {
    uint64_t counts = 0, nexts = 0;  // [rays]
    uint64_t fitting = 0;            // [1]
    uint64_t partials = 0;
  };
  RayScratch rayScratch(uint32_t rays);
  // A kernel that marches, twice: samples are counted, then written. march.h fills in what is
  // common to all.
  template <class Options, class Arguments>
  void queueMarch(std::span<const uint32_t> inDouble, std::span<const uint32_t> inFloat, const Options& options,
                  Arguments& arguments);
  void zeroRows(const Count& rows, uint32_t columns, const Slice<float>& numbers);
  void moveRows(const Count& rows, const Slice<const uint32_t>& source, const Matrix<const float>& from,
                const Matrix<const float>& to, bool scatter);
  // Runs a kernel whose workgroups leave `columns` sums each at arguments.partials, and adds those up.
  template <class Arguments>
  void queueSums(const GpuKernel& kernel, Arguments& arguments, uint32_t groups, uint32_t columns, uint64_t sums) {
    arguments.partials = scratch(size_t{groups} * columns);
    queue(kernel, arguments, {groups});
    addPartials(arguments.partials, groups, columns, sums);
  }
  template <class Arguments, class Options>
  Arguments lookupArguments(const Options& options) const;  // of virtual grids and lattices
  void addPartials(uint64_t partials, uint32_t count, uint32_t columns, uint64_t sums);
  // The address of at least `floats` floats for use within one operation.
  uint64_t scratch(size_t floats);
  // The network's weights as its kernels read them: themselves, or copies in fp16 at `scratch`.
  uint64_t weightNumbers(const Slice<const float>& weights, uint64_t scratch);
  void queueWeightGradients(const arguments::MlpWeightGradientsArguments& sums, size_t capacity);

  std::shared_ptr<GpuStream> stream_;
  // 0 and the largest number. What all invocations would read of nothing is read of it instead: Mesa's driver for the
  // processor (26.2) reads such words where no invocation comes, too.
  GpuBuffer noCounter_;
  CountedGroups countedGroups_;
  MlpArithmetic mlpArithmetic_;
  GpuMatrices matrices_;
  std::map<std::pair<const uint32_t*, std::vector<uint32_t>>, GpuKernel> kernels_;
  GpuBuffer scratch_;
};

// The device address of a slice; 0 for an empty one.
template <class T>
uint64_t deviceAddress(const Slice<T>& slice) {
  if (!slice) return 0;
  return static_cast<const VulkanMemory*>(slice.memory)->buffer().address() + slice.first * sizeof(T);
}

// Of what kernels read in fours: it lies at a multiple of 16 bytes.
inline uint64_t quadAddress(const Slice<const float>& slice) {
  const uint64_t address = deviceAddress(slice);
  CHECK(address % 16 == 0u);
  return address;
}

// CHECKs that a kernel's 32-bit indices reach the last of `rows` rows.
arguments::MatrixArguments matrixArguments(const Matrix<const float>& matrix, size_t rows);

}  // namespace tessera
