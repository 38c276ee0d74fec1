// How fast each operation of a device runs, beside what the machine could do at best, measured in the same run
// (Williams et al. 2009, the roofline model). What is counted:
//
//   networks       2 · parameters · samples forward (a multiply and an add a weight), twice that backward (the gradient
//                  of the weights and that of the inputs); padding of inputs and outputs is not counted. Beside the
//                  arithmetic's limit (the matrix units', where there are any) memory's: as much as is done while
//                  inputs, outputs and what is kept of activations are copied, and backward their gradients
//   hash grid      8 corners · levels · samples lookups, forward (read) as backward (read, add, write)
//   virtual grid   20 corners · samples lookups; the limit is the lower of two rates: gathers from a table of what the
//                  corners are looked up in (a bit each of all texels to find those needed, 8 bytes each of those
//                  needed forward, 32 backward), and as many lookups as are done while the arguments are copied:
//                  16 bytes a sample for where it is, 8 for every 32 texels (bits and ranks), then 12 a needed texel
//                  (finding), 32 a needed texel and 32 a sample (forward), 32 and 64 (backward)
//   lattice        8 corners · samples lookups, 64 bytes each; the limit likewise: 64 bytes a needed corner and a
//   sample all others     bytes of their arguments, each array once however often a kernel passes over it; the limit is
//   a copy
//                  of the same footprint (to the next power of two)
//
// The limit of the hash grid is the gather rate of tables of the same sizes, level by level: lookups / Σ (lookups of a
// level / rate of its size). Ray-like positions revisit cells that the cache still holds and may pass it.
// Every time is the best of several: what the code can do, not what the machine was disturbed to.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "compute/device.h"

namespace tessera {

struct RooflineOptions {
  DeviceOptions device;
  std::vector<uint32_t> samples = {65536, 8192};  // of networks and hash grid
  uint32_t streamed = 1 << 20;                    // samples of the operations that only stream: more than caches hold
  double secondsPerRow = 0.15;                    // repeats for so long, and at least 3 times
};

// Of all threads, or the whole card. Zero where it is not measured: on the reference device.
struct MachineLimits {
  double flops = 0;        // multiply-adds on registers, 2 operations each, per second
  double matrixFlops = 0;  // MachineProbe::matrixFlops
  struct Stream {
    size_t bytes = 0;  // footprint: half of it is copied to the other half
    double rate = 0;   // bytes read + written per second
  };
  std::vector<Stream> streams;  // by footprint
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
  double rate = 0;     // per second
  std::string unit;    // "FLOP", "lookup", "B"
  double limit = 0;    // per second; 0: not known
  // Likewise, while the arguments are copied once: of networks, which small ones never reach the arithmetic's limit
  // for.
  double memoryLimit = 0;
  double share() const { return limit > 0 ? rate / limit : 0; }
  // Of the lower of both.
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

// Throws Error when there is no such device.
Roofline measureRoofline(const RooflineOptions& options);

// Samples as marching makes them: `perRay` points half a finest cell or so apart on each of `rays` random lines in
// [0,1]³. [rays · perRay][3], a function of the arguments alone.
std::vector<float> rayLikePositions(uint32_t rays, uint32_t perRay, uint64_t seed);

}  // namespace tessera
