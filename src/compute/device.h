// The interface of the compute devices. Training is written against Device and does not depend on the hardware.
// Operations are queued in order, and nothing is read back in the middle of a step; `read` and `finish` wait for the
// queue.
//
// Each operation is a struct of arguments (shapes, inputs, outputs) in a header named after its kind, which also
// declares its name (operation.h). This header includes none of them, so that a new operation rebuilds its users only.
// reference/, cpu/ and vulkan/ each implement it in a file of the same name. device_test.cpp tests every operation on
// every device with many shapes: an operation without test cases there does not link.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

struct MlpShape;

class Device {
 public:
  virtual ~Device() = default;

  // `name` is a description for people: "cpu AVX3_ZEN4, 2 threads". `target` is the part of it on which the exact bits
  // of results depend: "cpu/AVX3".
  virtual std::string name() const = 0;
  virtual std::string target() const = 0;

  // The dedicated memory of a GPU, and how much of it this device has allocated. Zeros for devices without any.
  struct OwnMemory {
    uint64_t bytes = 0, inUse = 0;
  };
  virtual OwnMemory ownMemory() const { return {}; }
  // On a GPU, the following functions and run() throw Error if memory is insufficient, an operation has more numbers
  // than indices of 32 bits reach, or the device is lost; on the CPU, allocate() throws std::bad_alloc.
  virtual std::unique_ptr<Memory> allocate(size_t bytes) = 0;  // filled with zeros
  virtual void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) = 0;
  struct Reading {
    const Memory* from = nullptr;
    size_t offset = 0;
    std::span<std::byte> to;
  };
  virtual void readBytes(std::span<const Reading> readings) = 0;           // waits once for all readings
  virtual void fillZero(Memory& memory, size_t offset, size_t bytes) = 0;  // multiples of 4
  virtual void finish() = 0;

  // The number of CPU threads for the work that training does on the host between steps, such as drawing random rays.
  int hostThreads() const { return hostThreads_; }
  void setHostThreads(int threads) { hostThreads_ = threads; }

  // Whether activations of networks are stored in fp16, two per 32-bit word, instead of as floats.
  virtual bool storesActivationsInHalf() const { return false; }

  // Queues an operation. Every device runs every operation of the list in operations.h. Passing one that is not listed
  // there is a programming error: a CHECK that names the operation fails.
  template <class Arguments>
  void run(const Arguments& arguments) {
    static_assert(Operation<Arguments>, "not an operation: TESSERA_OPERATION is missing below the struct");
    if (!runOperation(kOperation<Arguments>, &arguments)) lacks(kOperation<Arguments>);
  }

  template <class T>
  Array<T> array(size_t count) {
    return count ? Array<T>(allocate(count * sizeof(T)), count) : Array<T>();
  }
  // Allocates the activations that MlpForward stores for MlpBackward.
  Array<float> allocateActivations(const MlpShape& shape, size_t samples);
  template <class T>
  Array<T> uploadArray(const std::vector<T>& values) {
    Array<T> uploaded = array<T>(values.size());
    if (!values.empty()) write(uploaded.all(), std::span<const T>(values));
    return uploaded;
  }
  template <class T>
  void write(const Slice<T>& to, std::span<const T> from) {
    CHECK(from.size() <= to.count);
    if (!from.empty()) writeBytes(*to.memory, to.first * sizeof(T), std::as_bytes(from));
  }
  template <class T>
  std::vector<std::remove_const_t<T>> read(const Slice<T>& from) {
    return std::get<0>(readAll(from));
  }
  // Reads several slices and waits only once.
  template <class... T>
  std::tuple<std::vector<std::remove_const_t<T>>...> readAll(const Slice<T>&... from) {
    std::tuple<std::vector<std::remove_const_t<T>>...> all{std::vector<std::remove_const_t<T>>(from.count)...};
    std::vector<Reading> readings;
    const auto add = [&](const auto& slice, auto& to) {
      if (to.empty()) return;
      readings.push_back({slice.memory, slice.first * sizeof to[0], std::as_writable_bytes(std::span(to))});
    };
    std::apply([&](auto&... to) { (add(from, to), ...); }, all);
    if (!readings.empty()) readBytes(readings);
    return all;
  }
  template <class T>
  void fillZero(const Slice<T>& slice) {
    if (slice) fillZero(*slice.memory, slice.first * sizeof(T), slice.count * sizeof(T));
  }

 private:
  // Queues an operation; `arguments` points to the struct that `operation` identifies. Returns false if the operation
  // is not on the list.
  virtual bool runOperation(const OperationId& operation, const void* arguments) = 0;
  void lacks(const OperationId& operation) const;

  int hostThreads_ = 1;
};

struct DeviceOptions {
  std::string kind = "cpu";  // auto, cpu, reference, vulkan, vulkan:1 (an index) or vulkan:radeon (a part of a name)
  int threads = 0;           // CPU threads; 0: all cores for the cpu device, a few for the host work of other devices
};

// Opens a device. "auto" selects the best usable GPU, or the cpu device if there is none, but never a Vulkan driver
// that computes on the CPU. Throws Error if this machine has no such device.
std::unique_ptr<Device> makeDevice(const DeviceOptions& options);

// Returns the index or the part of a name (see GpuOptions::device) if `kind` selects a Vulkan device on this machine,
// which includes "auto"; otherwise nothing.
std::optional<std::string> parseVulkanDevice(const std::string& kind);

// A device that DeviceOptions::kind can name on this machine.
struct DeviceDescription {
  std::string kind;  // "cpu", "vulkan:0"
  std::string name;
  uint64_t memoryBytes = 0;           // GPUs only
  std::string missing;                // why it cannot be used; empty if it can
  std::vector<std::string> features;  // GPUs only: the optional features that the kernels use
};
std::vector<DeviceDescription> listDevices();

}  // namespace tessera
