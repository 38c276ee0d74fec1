#include "compute/reference/device.h"

#include <cstring>

#include "compute/host_memory.h"
#include "compute/operations.h"

namespace tessera {

// Every operation on float buffers in HostMemory: converts inputs to double, calls functions.h and stores floats. There
// is one file per interface header.
namespace reference {
#define TESSERA_DECLARE(name) void run(const name&);
TESSERA_OPERATIONS(TESSERA_DECLARE)
#undef TESSERA_DECLARE
}  // namespace reference

namespace {

std::byte* bytesAt(const Memory& memory, size_t offset, size_t length) {
  CHECK(offset + length <= memory.bytes());
  return const_cast<HostMemory&>(static_cast<const HostMemory&>(memory)).data() + offset;
}

class ReferenceDevice final : public Device {
 public:
  std::string name() const override { return "reference"; }
  std::string target() const override { return "reference"; }

  std::unique_ptr<Memory> allocate(size_t bytes) override { return std::make_unique<HostMemory>(bytes); }
  void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) override {
    std::memcpy(bytesAt(to, offset, from.size()), from.data(), from.size());
  }
  void readBytes(std::span<const Reading> readings) override {
    for (const Reading& reading : readings) {
      std::memcpy(reading.to.data(), bytesAt(*reading.from, reading.offset, reading.to.size()), reading.to.size());
    }
  }
  void fillZero(Memory& memory, size_t offset, size_t bytes) override {
    std::memset(bytesAt(memory, offset, bytes), 0, bytes);
  }
  void finish() override {}

 private:
  bool runOperation(const OperationId& operation, const void* arguments) override {
    return dispatchOperation(operation, arguments, [](const auto& typed) { reference::run(typed); });
  }
};

}  // namespace

std::unique_ptr<Device> makeReferenceDevice() {
  return std::make_unique<ReferenceDevice>();
}

}  // namespace tessera
