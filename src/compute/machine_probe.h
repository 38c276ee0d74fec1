// What a machine could do at best, measured: the limits that operations are held against (compute/roofline.h).
#pragma once

#include <cstddef>

namespace tessera {

class MachineProbe {
 public:
  virtual ~MachineProbe() = default;

  // Multiply-adds on registers alone, counted as 2 operations each, per second.
  virtual double flops() = 0;
  // Of units that multiply matrices of fp16, summed in float; 0 where the device's networks use none.
  virtual double matrixFlops() { return 0; }
  // 8-byte loads per second at random places of each of so many tables of `bytes`.
  virtual double gatherRate(size_t bytes, int tables) = 0;
  // Bytes per second, read + written, of copies from one half of `bytes` to the other.
  virtual double streamRate(size_t bytes) = 0;
};

}  // namespace tessera
