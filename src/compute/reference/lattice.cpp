#include "compute/lattice.h"

#include <bit>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

constexpr size_t kColumns = LatticeForward::kColumns;

// Calls call(sample, row of the corner, weight) for every corner whose row is below `rows`.
template <class Arguments, class Call>
void forCorners(const Arguments& a, size_t rows, const Call& call) {
  CHECK(a.grid.planes == 0u);
  const size_t samples = hostCount(a.samples);
  const Doubles positions = doubles(a.positions, 3 * samples);
  const Indices blocks = indices(a.blockOfSample, samples);
  const Indices marks = indices(a.marks, a.marks.count), ranks = indices(a.ranks, a.ranks.count);
  for (size_t s = 0; s < samples; ++s) {
    const std::vector<VirtualCorner> corners =
        virtualCorners(a.grid, {positions[3 * s], positions[3 * s + 1], positions[3 * s + 2]});
    for (size_t k = 0; k < corners.size(); ++k) {
      const size_t row = virtualRow(a.grid, marks, ranks, blocks[s], s, k, corners[k].texel);
      if (row < rows) call(s, row, corners[k].weight);
    }
  }
}

}  // namespace

void run(const LatticeForward& a) {
  const Doubles values = doubles(a.values, a.values.count);
  Doubles mixed(kColumns * hostCount(a.samples));
  forCorners(a, a.texels.capacity, [&](size_t s, size_t row, double weight) {
    for (size_t c = 0; c < kColumns; ++c) mixed[kColumns * s + c] += weight * values[kColumns * row + c];
  });
  store(a.mixed, mixed);
}

void run(const LatticeBackward& a) {
  const size_t rows = hostCount(a.texels);
  const Doubles upstream = doubles(a.mixedGradients, hostCount(a.samples));
  Doubles gradients(kColumns * rows);
  forCorners(a, rows, [&](size_t s, size_t row, double weight) {
    for (size_t c = 0; c < kColumns; ++c) gradients[kColumns * row + c] += weight * upstream[kColumns * s + c];
  });
  store(a.valueGradients, gradients);
}

}  // namespace tessera::reference
