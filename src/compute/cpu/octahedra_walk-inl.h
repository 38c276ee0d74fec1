// The walk of rays through the cells of grids. Part of trace_octahedra.cpp, which includes it once for each SIMD
// target.
#if defined(TESSERA_COMPUTE_CPU_OCTAHEDRA_WALK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TESSERA_COMPUTE_CPU_OCTAHEDRA_WALK_INL_H_
#undef TESSERA_COMPUTE_CPU_OCTAHEDRA_WALK_INL_H_
#else
#define TESSERA_COMPUTE_CPU_OCTAHEDRA_WALK_INL_H_
#endif

#include <hwy/highway.h>

#include <cmath>
#include <limits>

#include "compute/cpu/trace_octahedra.h"

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Double = hn::CappedTag<double, kMaxLanes>;
using Doubles = hn::Vec<Double>;

// Lists the occupied cells that some rays cross, one per lane.
class Walk {
 public:
  // Lane i is number `firstList` + i in the scratch space.
  Walk(const TracedOctahedra& all, TraceScratch& scratch, uint32_t firstList, const Crossing* crossings, uint32_t count)
      : blocks_(all.blocks), scratch_(scratch), firstList_(firstList) {
    const Double d;
    alignas(64) double entries[3][kMaxLanes] = {}, steps[3][kMaxLanes] = {}, inverses[3][kMaxLanes] = {},
                       biases[3][kMaxLanes] = {}, ups[3][kMaxLanes] = {}, cells[3][kMaxLanes] = {},
                       lasts[kMaxLanes] = {}, grids[kMaxLanes] = {};
    for (uint32_t lane = 0; lane < count; ++lane) {
      const Crossing& crossing = crossings[lane];
      scratch_.cellCounts[firstList + lane] = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double step = crossing.step[axis];
        const bool isParallel = std::abs(step) < 1e-30;  // to the walls
        entries[axis][lane] = crossing.entry[axis];
        steps[axis][lane] = step;
        inverses[axis][lane] = isParallel ? 0 : 1 / step;
        biases[axis][lane] = isParallel ? std::numeric_limits<double>::infinity() : 0;
        ups[axis][lane] = step > 0 ? 1 : 0;
        cells[axis][lane] = crossing.cell[axis];
      }
      lasts[lane] = crossing.last;
      grids[lane] = static_cast<double>(crossing.grid) * blocks_.blocksInGrid();
    }
    for (int axis = 0; axis < 3; ++axis) {
      entry_[axis] = hn::Load(d, entries[axis]);
      step_[axis] = hn::Load(d, steps[axis]);
      inverse_[axis] = hn::Load(d, inverses[axis]);
      bias_[axis] = hn::Load(d, biases[axis]);
      up_[axis] = hn::Load(d, ups[axis]);
      cell_[axis] = hn::Load(d, cells[axis]);
    }
    last_ = hn::Load(d, lasts);
    firstBlock_ = hn::Load(d, grids);
    n_ = hn::Set(d, all.a.grids[0].resolution);
    blocksAlong_ = hn::Set(d, blocks_.blocks());
    s_ = hn::Zero(d);
    active_ = hn::FirstN(d, count);
    isActive_ = count > 0;
  }

  static uint32_t lanes() { return static_cast<uint32_t>(hn::Lanes(Double())); }
  bool isActive() const { return isActive_; }

  // Moves each ray to the next cell, or beyond a cube of empty cells.
  HWY_INLINE void step() {
    const Double d;
    const Word words;
    const Doubles zero = hn::Zero(d), one = hn::Set(d, 1), four = hn::Set(d, 4), quarter = hn::Set(d, 0.25);
    const auto noCells = hn::Zero(words);
    Doubles block[3], local[3];
    for (int axis = 0; axis < 3; ++axis) {
      block[axis] = hn::Floor(hn::Mul(cell_[axis], quarter));
      local[axis] = hn::NegMulAdd(block[axis], four, cell_[axis]);
    }
    const Doubles blockIndex =
        hn::Add(firstBlock_, hn::MulAdd(hn::MulAdd(block[2], blocksAlong_, block[1]), blocksAlong_, block[0]));
    const Doubles bit = hn::MulAdd(hn::MulAdd(local[2], four, local[1]), four, local[0]);
    const auto mask = hn::GatherIndex(words, blocks_.masks(), hn::ConvertTo(Index(), blockIndex));
    const auto shift = hn::BitCast(words, hn::ConvertTo(Index(), bit));
    const auto isEmpty = hn::RebindMask(d, hn::Eq(mask, noCells));
    // The cube of 2³ cells around the cell: bits 0, 1, 4, 5, 16, 17, 20 and 21 from its first one on.
    const auto pair = hn::And(mask >> hn::And(shift, hn::Set(words, 42)), hn::Set(words, 0x330033));
    const auto isPairEmpty = hn::RebindMask(d, hn::Eq(pair, noCells));
    const auto isOccupied =
        hn::And(active_, hn::RebindMask(d, hn::Ne(hn::And(mask >> shift, hn::Set(words, 1)), noCells)));
    // The ray leaves the largest cube around the cell that has no occupied cell, or the cell.
    const Doubles edge = hn::IfThenElse(isEmpty, four, hn::IfThenElse(isPairEmpty, hn::Set(d, 2), one));
    const Doubles inverseEdge = hn::IfThenElse(isEmpty, quarter, hn::IfThenElse(isPairEmpty, hn::Set(d, 0.5), one));
    Doubles low[3], at[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = hn::Mul(hn::Floor(hn::Mul(cell_[axis], inverseEdge)), edge);
      at[axis] = hn::MulAdd(hn::Sub(hn::MulAdd(edge, up_[axis], low[axis]), entry_[axis]), inverse_[axis], bias_[axis]);
    }
    const Doubles leave = hn::Min(hn::Min(at[0], at[1]), at[2]);
    if (!hn::AllFalse(d, isOccupied)) list(isOccupied, leave);
    s_ = hn::Max(s_, leave);
    // To the cell beyond the wall. Along the other axes, rounding may choose the neighbour of a cell at its wall: the
    // ray then leaves that cell where it entered it.
    const auto throughX = hn::Eq(at[0], leave), throughY = hn::AndNot(throughX, hn::Eq(at[1], leave));
    const hn::Mask<Double> through[3] = {throughX, throughY, hn::Not(hn::Or(throughX, throughY))};
    auto goesOn = hn::And(active_, hn::Lt(leave, last_));
    for (int axis = 0; axis < 3; ++axis) {
      const Doubles inside = hn::Min(hn::Max(hn::Floor(hn::MulAdd(s_, step_[axis], entry_[axis])), low[axis]),
                                     hn::Sub(hn::Min(hn::Add(low[axis], edge), n_), one));
      // low + edge if the coordinate rises, low - 1 if not
      const Doubles beyond = hn::Sub(hn::MulAdd(edge, up_[axis], low[axis]), hn::Sub(one, up_[axis]));
      cell_[axis] = hn::IfThenElse(through[axis], beyond, inside);
      goesOn = hn::And(goesOn, hn::And(hn::Ge(cell_[axis], zero), hn::Lt(cell_[axis], n_)));
    }
    for (int axis = 0; axis < 3; ++axis) cell_[axis] = hn::IfThenElseZero(goesOn, cell_[axis]);
    active_ = goesOn;
    isActive_ = !hn::AllFalse(d, goesOn);
  }

 private:
  using Index = hn::RebindToSigned<Double>;
  using Word = hn::RebindToUnsigned<Double>;

  HWY_INLINE void list(hn::Mask<Double> lanes, Doubles leave) {
    const Double d;
    alignas(64) double enters[kMaxLanes], leaves[kMaxLanes], cells[3][kMaxLanes];
    hn::Store(s_, d, enters);
    hn::Store(leave, d, leaves);
    for (int axis = 0; axis < 3; ++axis) hn::Store(cell_[axis], d, cells[axis]);
    uint8_t bits[8] = {};
    hn::StoreMaskBits(d, lanes, bits);
    for (uint32_t rest = bits[0]; rest != 0; rest &= rest - 1) {
      const uint32_t lane = static_cast<uint32_t>(std::countr_zero(rest));
      size_t& count = scratch_.cellCounts[firstList_ + lane];
      if (count == scratch_.cellsOfRay) continue;
      CrossedCell& to = scratch_.cells[(firstList_ + lane) * scratch_.cellsOfRay + count++];
      to.enter = enters[lane];
      to.leave = leaves[lane];
      for (int axis = 0; axis < 3; ++axis) to.cell[axis] = static_cast<int>(cells[axis][lane]);
    }
  }

  const OccupiedBlocks& blocks_;
  TraceScratch& scratch_;
  const uint32_t firstList_;
  Doubles entry_[3], step_[3], inverse_[3], bias_[3];  // (wall - entry) · inverse + bias is s at a wall
  Doubles up_[3];                                      // 1 if the coordinate rises, else 0
  Doubles cell_[3], s_, last_, firstBlock_, n_, blocksAlong_;
  hn::Mask<Double> active_;
  bool isActive_;
};

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
