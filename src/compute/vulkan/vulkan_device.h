// Device on a GpuStream: every operation copies its arguments, queues its kernels and returns.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "compute/device.h"
#include "gpu/stream.h"
#include "shaders/compute/arguments.h"

namespace tessera {

class VulkanMemory : public Memory {
 public:
  VulkanMemory(std::shared_ptr<GpuStream> stream, size_t bytes);
  ~VulkanMemory() override { stream_->retire(std::move(buffer_)); }
  const GpuBuffer& buffer() const { return buffer_; }

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer buffer_;
};

class VulkanDevice : public Device {
 public:
  explicit VulkanDevice(std::shared_ptr<const GpuContext> context);

  std::string name() const override;
  std::string target() const override;
  std::unique_ptr<Memory> allocate(size_t bytes) override;
  void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) override;
  void readBytes(const Memory& from, size_t offset, std::span<std::byte> to) override;
  void fillZero(Memory& memory, size_t offset, size_t bytes) override;
  void finish() override;
  bool supports(Operation operation) const override;

  using Device::fillZero;
  using Device::run;
  void run(const HashGridForward& options) override;
  void run(const HashGridBackward& options) override;
  void run(const MlpForward& options) override;
  void run(const MlpBackward& options) override;
  void run(const Adam& options) override;

 private:
  // Compiled at first use. `constants` are the shader's specialization constants in order.
  const GpuKernel& kernel(std::span<const uint32_t> spirv, std::vector<uint32_t> constants = {});
  // Chooses between the two forms of a kernel that adds to sums from many invocations.
  const GpuKernel& sumKernel(std::span<const uint32_t> withFloatAtomics, std::span<const uint32_t> without,
                             std::vector<uint32_t> constants = {});
  template <class Arguments>
  void queue(const GpuKernel& kernel, const Arguments& arguments, Groups groups) {
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), groups);
  }
  // Enough workgroups of `perGroup` for `count`, or the most there may be: kernels share out what is left.
  uint32_t groups(size_t count, size_t perGroup) const;
  // The address of at least `floats` floats for use within one operation.
  uint64_t scratch(size_t floats);

  std::shared_ptr<GpuStream> stream_;
  std::map<std::pair<const uint32_t*, std::vector<uint32_t>>, GpuKernel> kernels_;
  GpuBuffer scratch_;
};

// The device address of a slice; 0 for an empty one.
template <class T>
uint64_t deviceAddress(const Slice<T>& slice) {
  if (!slice) return 0;
  return static_cast<const VulkanMemory*>(slice.memory)->buffer().address() + slice.first * sizeof(T);
}

arguments::CountArguments countArguments(const Count& count);

// CHECKs that a kernel's 32-bit indices reach the last of `rows` rows.
arguments::MatrixArguments matrixArguments(const Matrix<const float>& matrix, size_t rows);

}  // namespace tessera
