// Measures the speed of each operation of a device relative to the peak performance of the machine, which is measured
// in the same run (the roofline model, Williams et al. 2009). The counted work:
//
//   networks       2 · parameters · samples forward (a multiply and an add per weight), and twice that backward (the
//                  gradients of the weights and of the inputs); padding of inputs and outputs is not counted. Besides
//                  the arithmetic limit (that of the matrix units, if there are any) there is a memory limit: the work
//                  done in the time of copying the inputs, outputs and stored activations, and for the backward pass
//                  also their gradients
//   hash grid      8 corners · levels · samples lookups, forward (read) and backward (read, add, write)
//   virtual grid   20 corners · samples lookups. The limit is the lower of two rates: that of gathers from a table of
//                  the size of the data (1 bit for every texel to find the needed ones, 8 bytes per needed texel
//                  forward, 32 backward), and that of the lookups done in the time of copying the arguments: 16 bytes
//                  per sample for its position and block, 8 bytes per 32 texels (bits and ranks), and 12 bytes per
//                  needed texel (finding), 32 per needed texel and 32 per sample (forward), or 32 and 64 (backward)
//   lattice        8 corners · samples lookups of 64 bytes; the limit is formed in the same way, with 64 bytes per
//                  needed corner and per sample
//   all others     the bytes of their arguments, counting each array once even if a kernel reads it several times; the
//                  limit is a copy with the same footprint (rounded up to a power of two)
//
// The limit of the hash grid is the gather rate of tables of the same sizes, level by level: lookups / Σ (lookups of a
// level / rate of its size). Ray-like positions revisit cells that are still in the cache, so they can exceed it.
// Every time is the best of several, so that disturbances by other processes do not count.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "compute/device.h"

namespace tessera {

struct RooflineOptions {
  DeviceOptions device;
  std::vector<uint32_t> samples = {65536, 8192};  // batch sizes for networks and hash grid
  uint32_t streamed = 1 << 20;                    // samples of streaming operations: more than fits into the caches
  double secondsPerRow = 0.15;                    // repeats each operation for this long, and at least 3 times
};

// The limits of all CPU threads together, or of the whole GPU. Zero if not measured, as on the reference device.
struct MachineLimits {
  double flops = 0;        // multiply-adds on registers, 2 operations each, per second
  double matrixFlops = 0;  // MachineProbe::matrixFlops
  struct Stream {
    size_t bytes = 0;  // footprint; one half of it is copied to the other
    double rate = 0;   // bytes read + written per second
  };
  std::vector<Stream> streams;  // one per footprint
  struct Gather {
    size_t tableBytes = 0;
    double lookups = 0;  // 8-byte loads at random places per second
  };
  std::vector<Gather> gathers;  // one per table size
};

struct RooflineRow {
  OperationId operation;
  std::string name, shape;
  double seconds = 0;  // of one run
  double rate = 0;     // in units per second
  std::string unit;    // "FLOP", "lookup", "B"
  double limit = 0;    // in units per second; 0 if unknown
  // The rate, in units per second, of a run that takes as long as copying its arguments once. Only for networks: small
  // ones are limited by memory and never reach the arithmetic limit.
  double memoryLimit = 0;
  double share() const { return limit > 0 ? rate / limit : 0; }
  // The share of the lower of both limits.
  double shareOfBoth() const {
    const double lower = memoryLimit > 0 ? std::min(limit, memoryLimit) : limit;
    return lower > 0 ? rate / lower : 0;
  }
};

struct Roofline {
  std::string device;
  MachineLimits limits;
  std::vector<RooflineRow> rows;
};

// Measures all operations of a device. Throws Error if there is no such device.
Roofline measureRoofline(const RooflineOptions& options);

// Returns positions like those from ray marching, [rays · perRay][3]: `perRay` points about half a finest cell apart on
// each of `rays` random lines in [0,1]³. Depends on the arguments alone.
std::vector<float> rayLikePositions(uint32_t rays, uint32_t perRay, uint64_t seed);

}  // namespace tessera
