// Measures the peak performance of a machine: the limits to which operations are compared (compute/roofline.h).
#pragma once

#include <cstddef>

namespace tessera {

class MachineProbe {
 public:
  virtual ~MachineProbe() = default;

  // Floating-point operations per second of multiply-adds on registers alone, each counted as 2 operations.
  virtual double flops() = 0;
  // Floating-point operations per second of the matrix units (fp16 with float accumulators); 0 if the networks of the
  // device do not use any.
  virtual double matrixFlops() { return 0; }
  // 8-byte loads per second at random places in each of `tables` tables of `bytes` bytes.
  virtual double gatherRate(size_t bytes, int tables) = 0;
  // Bytes per second, read + written, of copies from one half of a buffer of `bytes` bytes to the other.
  virtual double streamRate(size_t bytes) = 0;
};

}  // namespace tessera
