// The one interface between what is computed and what computes it. Training is written against Device and knows no
// hardware. Operations are queued in order and never read back in the middle of a step; `read` and `finish` wait.
//
// Each operation is a struct of arguments (shapes, what is read, what is written) in a header named after its kind,
// with its name beside it (operation.h). This header knows none of them, so that a new operation rebuilds its users
// only. reference/, cpu/ and vulkan/ each have a file of the same name. device_test.cpp walks operation × device ×
// shape: an operation without a row there does not link.
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

  // For people: "cpu AVX3_ZEN4, 2 threads". `target` is the part that bits depend on: "cpu/AVX3".
  virtual std::string name() const = 0;
  virtual std::string target() const = 0;

  // Of a card that has memory of its own: how much, and how much of it is taken by this device. Else zeros.
  struct OwnMemory {
    uint64_t bytes = 0, inUse = 0;
  };
  virtual OwnMemory ownMemory() const { return {}; }
  virtual std::unique_ptr<Memory> allocate(size_t bytes) = 0;  // zeroed
  virtual void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) = 0;
  struct Reading {
    const Memory* from = nullptr;
    size_t offset = 0;
    std::span<std::byte> to;
  };
  virtual void readBytes(std::span<const Reading> readings) = 0;           // waits, once for all
  virtual void fillZero(Memory& memory, size_t offset, size_t bytes) = 0;  // multiples of 4
  virtual void finish() = 0;

  // Threads of the processor for what training does on the host between steps, such as drawing rays.
  int hostThreads() const { return hostThreads_; }
  void setHostThreads(int threads) { hostThreads_ = threads; }

  // Whether activations of networks are kept in fp16, two to a word; else as floats.
  virtual bool keepsHalves() const { return false; }

  // Queues an operation. Every device runs every operation of the list (operations.h); one that is not on it is our own
  // mistake (CHECK, which names it).
  template <class Arguments>
  void run(const Arguments& arguments) {
    static_assert(Operation<Arguments>, "this is no operation: no TESSERA_OPERATION stands below the struct");
    if (!runOperation(kOperation<Arguments>, &arguments)) lacks(kOperation<Arguments>);
  }

  template <class T>
  Array<T> array(size_t count) {
    return count ? Array<T>(allocate(count * sizeof(T)), count) : Array<T>();
  }
  // What MlpForward keeps for MlpBackward.
  Array<float> activationsOf(const MlpShape& shape, size_t samples);
  template <class T>
  Array<T> arrayOf(const std::vector<T>& values) {
    Array<T> made = array<T>(values.size());
    if (!values.empty()) write(made.all(), std::span<const T>(values));
    return made;
  }
  template <class T>
  void write(const Slice<T>& to, std::span<const T> from) {
    CHECK(from.size() <= to.count);
    if (!from.empty()) writeBytes(*to.memory, to.first * sizeof(T), std::as_bytes(from));
  }
  template <class T>
  std::vector<std::remove_const_t<T>> read(const Slice<T>& from) {
    return std::get<0>(readTogether(from));
  }
  // Several, for the time of one.
  template <class... T>
  std::tuple<std::vector<std::remove_const_t<T>>...> readTogether(const Slice<T>&... from) {
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
  // Queues the operation with the arguments that it names the type of. False: it is not on the list.
  virtual bool runOperation(const OperationId& operation, const void* arguments) = 0;
  void lacks(const OperationId& operation) const;

  int hostThreads_ = 1;
};

struct DeviceOptions {
  std::string kind = "cpu";  // auto, cpu, reference, vulkan, vulkan:1 (an index) or vulkan:radeon (a part of a name)
  int threads = 0;           // of the processor; 0: all cores for cpu, a few beside other devices
};

// Throws Error when there is no such device on this machine. "auto" is the best graphics card that can be used, else
// cpu; it is never a Vulkan driver that computes on the processor.
std::unique_ptr<Device> makeDevice(const DeviceOptions& options);

// Of a kind that means a Vulkan device on this machine (auto too): its index or a part of its name, as
// GpuOptions::device has it. Nothing: another kind.
std::optional<std::string> vulkanDeviceOf(const std::string& kind);

// What `kind` may name on this machine.
struct DeviceDescription {
  std::string kind;  // "cpu", "vulkan:0"
  std::string name;
  uint64_t memoryBytes = 0;           // of a graphics card
  std::string missing;                // why it cannot be used; empty where it can
  std::vector<std::string> features;  // of a graphics card: what its kernels make use of
};
std::vector<DeviceDescription> listDevices();

}  // namespace tessera
