// Shared by the parts of the roofline measurement: the device, its limits, and the rows measured so far.
#pragma once

#include <functional>

#include "compute/machine_probe.h"
#include "compute/roofline.h"

namespace tessera {

struct HashGrid;

class RooflineRecorder {
 public:
  // `isQueued` is whether the device queues operations instead of running them at once. `probe` measures the limits of
  // streams, which are added to `limits`; it is null if the device has no known limits.
  RooflineRecorder(Device& device, bool isQueued, MachineProbe* probe, const RooflineOptions& options,
                   MachineLimits& limits)
      : device_(device), isQueued_(isQueued), probe_(probe), options_(options), limits_(limits) {}

  struct Work {
    std::string name, shape;
    double amount = 0;  // units of work per run
    std::string unit;
    double limit = 0;        // units per second; 0 if unknown
    double memoryLimit = 0;  // units per second, see RooflineRow; 0 if it does not apply
  };
  // Times `run` and adds a row.
  void measure(const OperationId& operation, Work work, const std::function<void()>& run);
  // Times an operation that moves `bytes` bytes and adds a row.
  void measureStream(const OperationId& operation, std::string shape, double bytes, const std::function<void()>& run);

  Device& device() { return device_; }
  const RooflineOptions& options() const { return options_; }
  const MachineLimits& limits() const { return limits_; }
  std::vector<RooflineRow> takeRows() { return std::move(rows_); }

  // 8-byte loads per second at random places in a table of `bytes` bytes; 0 if not measured.
  double gatherLimit(size_t bytes);
  // Bytes per second, read and written, of a copy with a footprint of `bytes` bytes; 0 if not measured.
  double streamLimit(double bytes);

  Array<float> randomFloats(size_t count, float low, float high);

 private:
  Device& device_;
  bool isQueued_;
  MachineProbe* probe_;
  const RooflineOptions& options_;
  MachineLimits& limits_;
  std::vector<RooflineRow> rows_;
  uint64_t arrays_ = 0;
};

void measureNetworks(RooflineRecorder& recorder);
void measureHashGrids(RooflineRecorder& recorder, const HashGrid& grid);
void measureSampleStreams(RooflineRecorder& recorder);  // encodings, marching, compaction, compositing, cube maps
void measureBlockStreams(RooflineRecorder& recorder);   // sampling through blocks and proposals
void measureVirtualGrid(RooflineRecorder& recorder);
void measureAttention(RooflineRecorder& recorder);  // marching in blocks, lattice, fusing levels, shading
void measureOctahedra(RooflineRecorder& recorder);
void measurePatches(RooflineRecorder& recorder);
void measureParameterStreams(RooflineRecorder& recorder);  // losses, exposure, occupancy, Adam

}  // namespace tessera
