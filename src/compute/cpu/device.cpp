#include "compute/cpu/device.h"

#include <fmt/format.h>

#include <cstring>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"
#include "compute/operations.h"

namespace tessera {

namespace cpu {
#define TESSERA_KERNEL(name) void run(Context& context, const name& arguments);
TESSERA_OPERATIONS(TESSERA_KERNEL)
#undef TESSERA_KERNEL
}  // namespace cpu

namespace {

std::byte* bytesAt(Memory& memory, size_t offset, size_t length) {
  CHECK(offset + length <= memory.bytes());
  return static_cast<HostMemory&>(memory).data() + offset;
}

class CpuDevice final : public Device {
 public:
  explicit CpuDevice(int threads) : pool_(threads), context_{pool_} {}

  std::string name() const override { return fmt::format("cpu {}, {} threads", cpu::simdTarget(), pool_.threads()); }
  std::string target() const override { return fmt::format("cpu/{}", cpu::simdTarget()); }

  std::unique_ptr<Memory> allocate(size_t bytes) override { return std::make_unique<HostMemory>(bytes); }
  void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) override {
    std::memcpy(bytesAt(to, offset, from.size()), from.data(), from.size());
  }
  void readBytes(std::span<const Reading> readings) override {
    for (const Reading& reading : readings) {
      Memory& from = const_cast<Memory&>(*reading.from);
      std::memcpy(reading.to.data(), bytesAt(from, reading.offset, reading.to.size()), reading.to.size());
    }
  }
  void fillZero(Memory& memory, size_t offset, size_t bytes) override {
    std::byte* first = bytesAt(memory, offset, bytes);
    pool_.forRanges(bytes, size_t{1} << 20,
                    [&](size_t begin, size_t end) { std::memset(first + begin, 0, end - begin); });
  }
  void finish() override {}

 private:
  bool runOperation(const OperationId& operation, const void* arguments) override {
    return dispatchOperation(operation, arguments, [this](const auto& typed) { cpu::run(context_, typed); });
  }

  ThreadPool pool_;
  cpu::Context context_;
};

}  // namespace

std::unique_ptr<Device> makeCpuDevice(int threads) {
  return std::make_unique<CpuDevice>(threads);
}

}  // namespace tessera
