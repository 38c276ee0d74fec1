// Hits of rays on grids of octahedra on the CPU. A ray walks through the cells of a grid and, in each occupied cell, is
// tested against all faces that can reach into that cell: those of the octahedra among the 27 cells around it. Hits
// outside the cell are dropped, so that no face is hit twice and cells can be skipped. As vertices never leave their
// cells, nothing is missed but for rounding at the walls, and hits are sorted within a cell only.
//
// Several rays walk at a time, one per lane, and list the occupied cells that they cross; then each ray is tested in
// its cells, several faces at a time. The test is that of Woop et al. 2013 (ray/triangle intersection): the 27 vertices
// are sheared once so that the ray becomes the z axis; a face then needs three cross products. Rays and cells are
// computed in double, and the faces in float relative to the point at which the ray enters the cell.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/cpu/octahedra_cells.h"
#include "compute/cpu/octahedra_rays.h"
#include "compute/cpu/offsets.h"
#include "compute/host_memory.h"
#include "compute/octahedra.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/trace_octahedra.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

#ifndef TESSERA_CPU_TRACE_OCTAHEDRA_ONCE
#define TESSERA_CPU_TRACE_OCTAHEDRA_ONCE
namespace tessera::cpu {

inline constexpr size_t kRaysPerTask = 64;  // fixed; the hits of all tasks are concatenated in task order
inline constexpr size_t kCellsAtATime = 8;
inline constexpr size_t kMaxHitsInCell = 64;         // the nearest stay
inline constexpr uint32_t kMaxLanes = 8;             // of vectors of double
inline constexpr uint32_t kMaxRays = 2 * kMaxLanes;  // walk at a time

// What all rays of an operation share.
struct TracedOctahedra {
  const TraceOctahedra& a;
  OccupiedBlocks blocks;
  Candidates even, odd;  // by the parity of the sum of a cell's coordinates

  explicit TracedOctahedra(const TraceOctahedra& all)
      : a(all),
        blocks(all.grids, hostPointer(all.occupancy)),
        even(all.grids[0].placement, 0, all.grids[0].resolution),
        odd(all.grids[0].placement, 1, all.grids[0].resolution) {}
};

// A ray in one of the grids that it crosses: g = entry + s · step for s in [0, last], where the farthest coordinate
// advances by 1 per unit of s.
struct Crossing {
  HomogeneousRay line;
  uint32_t ray, grid;
  double near, far;  // distances
  double entry[3], step[3], last;
  int cell[3];  // the first one
  int z = 0;    // the axis along which the ray is longest

  Crossing(const TraceOctahedra& a, uint32_t rayNumber, uint32_t gridNumber, double nearest, double farthest)
      : line(a.grids[gridNumber], hostPointer(a.origins) + 3 * size_t{rayNumber},
             hostPointer(a.directions) + 3 * size_t{rayNumber}),
        ray(rayNumber),
        grid(gridNumber),
        near(nearest),
        far(farthest) {
    line.clip(a.grids[grid], &near, &far);
  }

  bool meetsGrid() const { return near < far; }
  // Sets what the walk needs; false if the ray has no direction in the grid.
  bool enter(int resolution) {
    double direction[3], largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      direction[axis] = line.slope[axis] * line.start[3] - line.start[axis] * line.slope[3];
      if (std::abs(direction[axis]) > largest) {
        largest = std::abs(direction[axis]);
        z = axis;
      }
    }
    if (!(largest > 0)) return false;
    const double scale = 1 / (line.start[3] + near * line.slope[3]);
    for (int axis = 0; axis < 3; ++axis) {
      step[axis] = direction[axis] / largest;
      entry[axis] =
          std::clamp((line.start[axis] + near * line.slope[axis]) * scale, 0.0, static_cast<double>(resolution));
      cell[axis] = std::min(static_cast<int>(entry[axis]), resolution - 1);
      // On a wall between two cells, the ray is in the one that it enters.
      if (step[axis] < 0 && cell[axis] > 0 && entry[axis] == cell[axis]) --cell[axis];
    }
    last = std::abs(line.at(far, z) - entry[z]);
    return true;
  }
};

// An occupied cell that a ray crosses from s = enter to leave.
struct CrossedCell {
  double enter, leave;
  int cell[3];
};

// Hits of a ray that are not yet in TaskHits; those of a cell are sorted.
struct PendingHits {
  struct Face {
    uint32_t face;
    float barycentrics[2];
  };
  static constexpr size_t kEnough = 64;  // are then moved to TaskHits
  static constexpr size_t kMax = kEnough + kMaxHitsInCell;

  alignas(64) double s[kMax + kMaxLanes];
  Face faces[kMax];
  size_t count = 0;
};

// The hits of some successive rays, as the operation returns them.
class TaskHits {
 public:
  size_t count() const { return count_; }
  void makeRoomFor(size_t more) {
    if (count_ + more <= faces.size()) return;
    const size_t size = 2 * (count_ + more);
    faces.resize(size);
    barycentrics.resize(2 * size);
    positions.resize(3 * size);
    distances.resize(size);
  }
  void add() { ++count_; }
  void clear() { count_ = 0; }

  std::vector<uint32_t> faces;
  std::vector<float> barycentrics, positions, distances;

 private:
  size_t count_ = 0;
};

// What a thread needs while it traces.
struct TraceScratch {
  std::vector<Crossing> crossings;
  std::unique_ptr<CrossedCell[]> cells;  // [kMaxRays][cellsOfRay]
  size_t cellsOfRay = 0, cellCounts[kMaxRays] = {};
  PendingHits pending;

  void makeRoomFor(uint32_t resolution) {
    // Coordinates change in one direction only, but for those that repeat by rounding.
    const size_t most = 3 * size_t{resolution} + 8;
    if (most <= cellsOfRay) return;
    cellsOfRay = most;
    cells.reset(new CrossedCell[kMaxRays * cellsOfRay]);
  }
};

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Float = hn::CappedTag<float, 16>;
using Floats = hn::Vec<Float>;
using Int = hn::RebindToSigned<Float>;
using Ints = hn::Vec<Int>;

// A table of kSlots numbers.
struct Table {
#if HWY_TARGET == HWY_AVX3
  Floats low, high;

  // Highway 1.0 has no lookup in two vectors.
  HWY_INLINE Floats lookup(Ints slots) const {
    return Floats{_mm512_permutex2var_ps(low.raw, slots.raw, high.raw)};
  }
#else
  alignas(64) float values[kSlots];

  HWY_INLINE Floats lookup(Ints slots) const {
    alignas(64) int32_t each[16];
    alignas(64) float gathered[16];
    hn::Store(slots, Int(), each);
    for (size_t i = 0; i < hn::Lanes(Int()); ++i) gathered[i] = values[each[i] & (kSlots - 1)];
    return hn::Load(Float(), gathered);
  }
#endif
};

// The vertices of the 27 cells around one, relative to its centre.
struct VerticesAround {
  uint32_t cell = 0xffffffffu;  // in all grids
  alignas(64) float at[3][kSlots];

  // `rows`: the displacements of the three cells along x, in the order of y, then z.
  HWY_INLINE void set(const float* const rows[9]) {
    const Float d;
#if HWY_TARGET == HWY_AVX3
    Floats all[2][3];
    deinterleave(rows, all);
#else
    alignas(64) float around[3 * kSlots] = {};
    for (int row = 0; row < 6; ++row) std::memcpy(around + (row < 3 ? 0 : 48 - 27) + 9 * row, rows[row], 36);
    std::memcpy(around + 27, rows[6], 36);
    std::memcpy(around + 36, rows[7], 36);
    std::memcpy(around + 45, rows[8], 12);
    std::memcpy(around + 75, rows[8] + 3, 24);
#endif
    for (int first = 0; first < kSlots; first += static_cast<int>(hn::Lanes(d))) {
      Floats displacements[3];
#if HWY_TARGET == HWY_AVX3
      for (int axis = 0; axis < 3; ++axis) displacements[axis] = all[first / 16][axis];
#else
      hn::LoadInterleaved3(d, around + 3 * first, displacements[0], displacements[1], displacements[2]);
#endif
      for (int axis = 0; axis < 3; ++axis)
        hn::Store(hn::Add(hn::Load(d, kSlotOffsets.at[axis] + first), displacements[axis]), d, at[axis] + first);
    }
  }

#if HWY_TARGET == HWY_AVX3
 private:
  // Coordinates by vector of slots and axis.
  static HWY_INLINE void deinterleave(const float* const rows[9], Floats all[2][3]) {
    // The 27 numbers of three rows fill one vector, and 11 lanes of another.
    __m512 from[3][2];
    for (int z = 0; z < 3; ++z) {
      const float* const* const row = rows + 3 * z;
      from[z][0] = _mm512_mask_loadu_ps(_mm512_maskz_loadu_ps(0x01ff, row[0]), 0xfe00, row[1] - 9);
      from[z][1] = _mm512_mask_loadu_ps(_mm512_maskz_loadu_ps(0x0003, row[1] + 7), 0x07fc, row[2] - 2);
    }
    const __m512i three =
        _mm512_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21, 24, 0, 3, 6, 9, 12, 15, 18);  // also from lane 9 on
    const __m512i rest = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 0, 21, 24, 0, 0, 0, 0, 0);
    for (int axis = 0; axis < 3; ++axis) {
      const __m512i add = _mm512_set1_epi32(axis);
      const __m512i index = _mm512_add_epi32(three, add), restIndex = _mm512_add_epi32(rest, add);
      all[0][axis] = Floats{_mm512_mask_mov_ps(_mm512_permutex2var_ps(from[0][0], index, from[0][1]), 0xfe00,
                                               _mm512_permutex2var_ps(from[2][0], index, from[2][1]))};
      all[1][axis] = Floats{_mm512_mask_mov_ps(_mm512_permutex2var_ps(from[1][0], index, from[1][1]), 0xfe00,
                                               _mm512_permutex2var_ps(from[2][0], restIndex, from[2][1]))};
    }
  }
#endif
};

// Those of the last cells that rays crossed, as neighbouring rays cross the same ones.
class RecentVertices {
 public:
  HWY_INLINE VerticesAround& place(const int cell[3]) {
    return entries_[static_cast<uint32_t>(cell[0] + 5 * cell[1] + 3 * cell[2]) % kEntries];
  }

 private:
  static constexpr uint32_t kEntries = 16;
  VerticesAround entries_[kEntries];
};

// Vertices relative to a ray, sheared so that the ray is the z axis.
class ShearedVertices {
 public:
  // `origin`: a point of the ray relative to the centre of the middle cell; `shear`: its step along x and y for
  // one along z; `sign`: of its step along z.
  HWY_INLINE void set(const VerticesAround& vertices, const float origin[3], const float shear[2], float sign, int z) {
    const int x = z == 2 ? 0 : z + 1, y = z == 0 ? 2 : z - 1;
    const Float d;
    const Floats shearX = hn::Set(d, shear[0]), shearY = hn::Set(d, shear[1]), signs = hn::Set(d, sign);
    for (int first = 0, part = 0; first < kSlots; first += static_cast<int>(hn::Lanes(d)), ++part) {
      const auto at = [&](int axis) HWY_ATTR {
        return hn::Sub(hn::Load(d, vertices.at[axis] + first), hn::Set(d, origin[axis]));
      };
      const Floats atX = at(x), atY = at(y), atZ = at(z);
      put(tables[0], part, first, hn::NegMulAdd(shearX, atZ, atX));
      put(tables[1], part, first, hn::NegMulAdd(shearY, atZ, atY));
      put(tables[2], part, first, hn::Mul(atZ, signs));
    }
  }

  Table tables[3];

 private:
  static HWY_INLINE void put(Table& table, [[maybe_unused]] int part, [[maybe_unused]] int first, Floats values) {
#if HWY_TARGET == HWY_AVX3
    (part == 0 ? table.low : table.high) = values;
#else
    hn::Store(values, Float(), table.values + first);
#endif
  }
};

// Twice the signed areas of the ray with each edge: the barycentric coordinates of the opposite vertices.
struct EdgeAreas {
  Floats u, v, w;

  HWY_INLINE EdgeAreas(const ShearedVertices& vertices, Ints a, Ints b, Ints c) {
    const Table &x = vertices.tables[0], &y = vertices.tables[1];
    const Floats ax = x.lookup(a), ay = y.lookup(a), bx = x.lookup(b), by = y.lookup(b), cx = x.lookup(c),
                 cy = y.lookup(c);
    u = hn::MulSub(bx, cy, hn::Mul(by, cx));
    v = hn::MulSub(cx, ay, hn::Mul(cy, ax));
    w = hn::MulSub(ax, by, hn::Mul(ay, bx));
  }
};

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

// The faces near a cell that the line of a ray hits, in the cell or outside of it.
struct LineHits {
  ShearedVertices vertices;
  alignas(64) int32_t faces[Candidates::kMax + 16];  // as Candidates::packed
  size_t count;
};

// Tests a ray against the faces in the cells that it crosses.
class FaceTest {
 public:
  FaceTest(const TracedOctahedra& all, const Crossing& crossing, RecentVertices& recent, PendingHits& pending,
           TaskHits& hits)
      : all_(all),
        crossing_(crossing),
        grid_(all.a.grids[crossing.grid]),
        n_(static_cast<int>(grid_.resolution)),
        firstCell_(crossing.grid * grid_.cells()),
        displacements_(hostPointer(all.a.displacements) + size_t{3} * firstCell_),
        keptFaces_(hostPointer(all.a.keptFaces)),
        recent_(recent),
        pending_(pending),
        hits_(hits),
        positionScale_(grid_.positionScale()) {
    pending_.count = 0;
    const int z = crossing.z;
    shear_[0] = static_cast<float>(crossing.step[(z + 1) % 3] / crossing.step[z]);
    shear_[1] = static_cast<float>(crossing.step[(z + 2) % 3] / crossing.step[z]);
    sign_ = crossing.step[z] > 0 ? 1.0f : -1.0f;
  }

  HWY_INLINE void hitLine(const CrossedCell& crossed, LineHits& hits) const {
    const int* const cell = crossed.cell;
    const Candidates& faces = candidates(cell);
    const Float d;
    const Int ints;
    const Floats zero = hn::Zero(d);
    float origin[3];  // of the ray, relative to the centre of the cell
    for (int axis = 0; axis < 3; ++axis)
      origin[axis] =
          static_cast<float>(crossing_.entry[axis] + crossed.enter * crossing_.step[axis] - (cell[axis] + 0.5));
    const uint32_t number = firstCell_ + static_cast<uint32_t>(cell[0] + n_ * (cell[1] + n_ * cell[2]));
    VerticesAround& around = recent_.place(cell);
    if (around.cell != number) {
      const float* rows[9];
      float border[81];
      listRows(cell, border, rows);
      around.set(rows);
      around.cell = number;
    }
    hits.vertices.set(around, origin, shear_, sign_, crossing_.z);
    const ShearedVertices vertices = hits.vertices;
    size_t count = 0;
    for (int firstCandidate = 0; firstCandidate < faces.count; firstCandidate += static_cast<int>(hn::Lanes(d))) {
      const Ints packed = hn::Load(ints, faces.packed + firstCandidate);
      const EdgeAreas areas(vertices, packed, hn::ShiftRight<8>(packed), hn::ShiftRight<16>(packed));
      const Floats smallest = hn::Min(areas.u, hn::Min(areas.v, areas.w));
      const Floats largest = hn::Max(areas.u, hn::Max(areas.v, areas.w));
      // NaN compares false, but Min and Max may drop it: the sum does not.
      const Floats sum = hn::Add(areas.u, hn::Add(areas.v, areas.w));
      const auto isHit = hn::And(hn::Gt(hn::Abs(sum), zero), hn::Or(hn::Ge(smallest, zero), hn::Le(largest, zero)));
      const auto mask = hn::RebindMask(ints, isHit);
      hn::StoreU(hn::Compress(packed, mask), ints, hits.faces + count);
      count += hn::CountTrue(ints, mask);
    }
    hits.count = count;
  }
  // Adds the hits in a cell to those pending, and may finish these; false if the ray has all that it may have: `most`
  // hits from `first` on.
  HWY_INLINE bool addHits(const CrossedCell& crossed, const LineHits& hits, size_t first, size_t most) {
    const int* const cell = crossed.cell;
    const uint32_t index = static_cast<uint32_t>(cell[0] + n_ * (cell[1] + n_ * cell[2]));
    const Candidates& faces = candidates(cell);
    const uint32_t firstFace = (firstCell_ + index) * kFacesPerCell;
    const Float d;
    const Int ints;
    const ShearedVertices& vertices = hits.vertices;
    PendingHits& near = pending_;
    const size_t firstOfCell = near.count;
    const float width = static_cast<float>(crossed.leave - crossed.enter);
    // Drops most hits outside of the cell; the others are compared in double.
    const Floats lowest = hn::Set(d, -1e-3f), highest = hn::Set(d, width + 1e-3f);
    for (size_t firstHit = 0; firstHit < hits.count; firstHit += hn::Lanes(d)) {
      const Ints packed = hn::LoadU(ints, hits.faces + firstHit);
      const Ints a = packed, b = hn::ShiftRight<8>(packed), c = hn::ShiftRight<16>(packed);
      const EdgeAreas areas(vertices, a, b, c);
      const Table& z = vertices.tables[2];
      const Floats total = hn::Add(areas.u, hn::Add(areas.v, areas.w));
      const Floats weighted =
          hn::MulAdd(areas.w, z.lookup(c), hn::MulAdd(areas.v, z.lookup(b), hn::Mul(areas.u, z.lookup(a))));
      const Floats inverse = hn::Div(hn::Set(d, 1.0f), total);
      const Floats along = hn::Mul(weighted, inverse);
      const auto isNear =
          hn::And(hn::FirstN(d, hits.count - firstHit), hn::And(hn::Ge(along, lowest), hn::Le(along, highest)));
      uint8_t bytes[8] = {};
      hn::StoreMaskBits(d, isNear, bytes);
      uint32_t bits = bytes[0] | uint32_t{bytes[1]} << 8;
      if (bits == 0) continue;
      alignas(64) float alongs[16], second[16], third[16];
      hn::Store(along, d, alongs);
      hn::Store(hn::Mul(areas.v, inverse), d, second);
      hn::Store(hn::Mul(areas.w, inverse), d, third);
      for (; bits != 0; bits &= bits - 1) {
        const uint32_t lane = static_cast<uint32_t>(std::countr_zero(bits));
        const double s = crossed.enter + double{alongs[lane]};
        if (!(s >= crossed.enter && s < crossed.leave)) continue;
        const uint32_t number =
            firstFace + faces.face[static_cast<uint32_t>(hits.faces[firstHit + lane]) >> Candidates::kNumberShift];
        if (keptFaces_ && (keptFaces_[number / 32] >> number % 32 & 1) == 0) continue;
        if (near.count - firstOfCell == kMaxHitsInCell) {
          if (!isBefore(s, number, near.count - 1)) continue;
          --near.count;
        }
        size_t place = near.count++;
        for (; place > firstOfCell && isBefore(s, number, place - 1); --place) {
          near.s[place] = near.s[place - 1];
          near.faces[place] = near.faces[place - 1];
        }
        near.s[place] = s;
        near.faces[place] = {number, {second[lane], third[lane]}};
      }
    }
    return near.count < PendingHits::kEnough && near.count < most ? true : finish(first, most);
  }
  // Moves pending hits to TaskHits; false if the ray has all that it may have.
  bool finish(size_t first, size_t most) {
    using Double = hn::CappedTag<double, kMaxLanes>;
    const Double d;
    const hn::Rebind<float, Double> floats;
    PendingHits& near = pending_;
    const size_t count = near.count;
    near.count = 0;
    hits_.makeRoomFor(count);
    const int z = crossing_.z;
    const HomogeneousRay& line = crossing_.line;
    for (size_t begin = 0; begin < count; begin += hn::Lanes(d)) {
      const auto s = hn::Load(d, near.s + begin);
      const auto at = [&](int axis) {
        return hn::MulAdd(s, hn::Set(d, crossing_.step[axis]), hn::Set(d, crossing_.entry[axis]));
      };
      // As HomogeneousRay::parameterAt.
      const auto g = at(z);
      const auto distance = hn::Div(hn::MulSub(g, hn::Set(d, line.start[3]), hn::Set(d, line.start[z])),
                                    hn::NegMulAdd(g, hn::Set(d, line.slope[3]), hn::Set(d, line.slope[z])));
      const auto isInside =
          hn::And(hn::Gt(distance, hn::Set(d, crossing_.near)), hn::Lt(distance, hn::Set(d, crossing_.far)));
      alignas(64) float distances[kMaxLanes], positions[3][kMaxLanes];
      hn::Store(hn::DemoteTo(floats, distance), floats, distances);
      for (int axis = 0; axis < 3; ++axis) {
        const auto position =
            hn::Mul(hn::DemoteTo(
                        floats, hn::Add(at(axis), hn::Set(d, double{grid_.positionOffset[static_cast<size_t>(axis)]}))),
                    hn::Set(floats, positionScale_));
        hn::Store(hn::Min(hn::Max(position, hn::Zero(floats)), hn::Set(floats, 1.0f)), floats, positions[axis]);
      }
      uint8_t bits[8] = {};
      hn::StoreMaskBits(d, isInside, bits);
      const size_t lanes = std::min(hn::Lanes(d), count - begin);
      for (size_t lane = 0; lane < lanes; ++lane) {
        if ((bits[0] >> lane & 1) == 0) continue;
        const size_t row = hits_.count();
        const PendingHits::Face& face = near.faces[begin + lane];
        hits_.faces[row] = face.face;
        hits_.barycentrics[2 * row] = face.barycentrics[0];
        hits_.barycentrics[2 * row + 1] = face.barycentrics[1];
        hits_.distances[row] = distances[lane];
        for (size_t axis = 0; axis < 3; ++axis) hits_.positions[3 * row + axis] = positions[axis][lane];
        hits_.add();
        if (hits_.count() - first >= most) return false;
      }
    }
    return true;
  }

 private:
  HWY_INLINE const Candidates& candidates(const int cell[3]) const {
    return (cell[0] + cell[1] + cell[2]) % 2 == 0 ? all_.even : all_.odd;
  }
  // Whether a hit comes before the pending one at `place`.
  bool isBefore(double s, uint32_t face, size_t place) const {
    return s != pending_.s[place] ? s < pending_.s[place] : face < pending_.faces[place].face;
  }
  // Lists the displacements of the three cells along x, in the order of y, then z. At the border of the grid, they are
  // in `border`, with NaN for cells that do not exist.
  HWY_INLINE void listRows(const int cell[3], float border[81], const float* rows[9]) const {
    const auto isInner = [&](int at) { return at > 0 && at < n_ - 1; };
    const bool inside = isInner(cell[0]) && isInner(cell[1]) && isInner(cell[2]);
    const int64_t first = 3 * (cell[0] - 1 + int64_t{n_} * (cell[1] - 1 + int64_t{n_} * (cell[2] - 1)));
    if (inside) {
      for (int row = 0; row < 9; ++row)
        rows[row] = displacements_ + first + 3 * int64_t{n_} * (row % 3 + int64_t{n_} * (row / 3));
      return;
    }
    const auto isBeyond = [&](int at) { return static_cast<uint32_t>(at) >= static_cast<uint32_t>(n_); };
    for (int row = 0; row < 9; ++row) {
      const int y = cell[1] + row % 3 - 1, z = cell[2] + row / 3 - 1;
      const int64_t from = first + 3 * int64_t{n_} * (row % 3 + int64_t{n_} * (row / 3));
      rows[row] = border + 9 * row;
      for (int i = 0; i < 3; ++i) {
        const bool exists = !isBeyond(cell[0] - 1 + i) && !isBeyond(y) && !isBeyond(z);
        for (int axis = 0; axis < 3; ++axis)
          border[9 * row + 3 * i + axis] =
              exists ? displacements_[from + 3 * i + axis] : std::numeric_limits<float>::quiet_NaN();
      }
    }
  }

  const TracedOctahedra& all_;
  const Crossing& crossing_;
  const OctahedraGrid& grid_;
  const int n_;
  const uint32_t firstCell_;          // of the grid
  const float* const displacements_;  // of the grid
  const uint32_t* const keptFaces_;   // of all grids; null: all are
  RecentVertices& recent_;
  PendingHits& pending_;
  TaskHits& hits_;
  const float positionScale_;
  float shear_[2], sign_;
};

// Adds the grids that a ray crosses, in order.
void addCrossings(const TraceOctahedra& a, uint32_t ray, std::vector<Crossing>& crossings) {
  const float* const direction = hostPointer(a.directions) + 3 * size_t{ray};
  if (a.maximum == 0 || (direction[0] == 0 && direction[1] == 0 && direction[2] == 0)) return;
  const double near =
      std::max(double{a.near}, distanceBehindBox(a.boxInFront, hostPointer(a.origins) + 3 * size_t{ray}, direction));
  const double far = a.farOfRay ? std::min(1e30, double{hostPointer(a.farOfRay)[ray]}) : 1e30;
  const size_t first = crossings.size();
  for (uint32_t grid = 0; grid < a.grids.size(); ++grid) {
    crossings.emplace_back(a, ray, grid, near, far);
    if (!crossings.back().meetsGrid() || !crossings.back().enter(static_cast<int>(a.grids[grid].resolution)))
      crossings.pop_back();
  }
  // The boxes of the grids are convex and do not overlap, so that a ray crosses them one after another.
  for (size_t i = first + 1; i < crossings.size(); ++i)
    for (size_t place = i; place > first && crossings[place].near < crossings[place - 1].near; --place)
      std::swap(crossings[place], crossings[place - 1]);
}

// Traces the rays from `begin` to `end`, and sets the number of hits of each.
void traceRays(const TracedOctahedra& all, uint32_t begin, uint32_t end, TraceScratch& scratch, TaskHits& hits,
               uint32_t* hitCounts) {
  std::vector<Crossing>& crossings = scratch.crossings;
  crossings.clear();
  for (uint32_t ray = begin; ray < end; ++ray) addCrossings(all.a, ray, crossings);
  std::fill(hitCounts, hitCounts + (end - begin), 0u);
  const uint32_t lanes = Walk::lanes();
  LineHits lineHits[kCellsAtATime];
  RecentVertices recent;
  for (size_t group = 0; group < crossings.size(); group += 2 * lanes) {
    const uint32_t count = static_cast<uint32_t>(std::min<size_t>(2 * lanes, crossings.size() - group));
    // Two walks at a time, as each step of a walk waits for the one before.
    const uint32_t firstCount = std::min(count, lanes);
    Walk first(all, scratch, 0, &crossings[group], firstCount);
    Walk second(all, scratch, firstCount, &crossings[group] + firstCount, count - firstCount);
    while (first.isActive() && second.isActive()) {
      first.step();
      second.step();
    }
    while (first.isActive()) first.step();
    while (second.isActive()) second.step();
    for (uint32_t lane = 0; lane < count; ++lane) {
      const Crossing& crossing = crossings[group + lane];
      uint32_t& hitCount = hitCounts[crossing.ray - begin];
      if (hitCount >= all.a.maximum) continue;
      const size_t firstHit = hits.count() - hitCount;
      FaceTest test(all, crossing, recent, scratch.pending, hits);
      bool wantsMore = true;
      const CrossedCell* const cells = &scratch.cells[lane * scratch.cellsOfRay];
      for (size_t i = 0; wantsMore && i < scratch.cellCounts[lane]; i += kCellsAtATime) {
        // One test after the other for several cells, as the branches of the second are hard to predict.
        const size_t cellCount = std::min(kCellsAtATime, scratch.cellCounts[lane] - i);
        for (size_t j = 0; j < cellCount; ++j) test.hitLine(cells[i + j], lineHits[j]);
        for (size_t j = 0; wantsMore && j < cellCount; ++j)
          wantsMore = test.addHits(cells[i + j], lineHits[j], firstHit, all.a.maximum);
      }
      if (wantsMore) test.finish(firstHit, all.a.maximum);
      hitCount = static_cast<uint32_t>(hits.count() - firstHit);
    }
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(traceRays);

namespace {

constexpr size_t kExpectedHits = 16;  // of a ray; more are only slower

}  // namespace

void run(Context& context, const TraceOctahedra& a) {
  CHECK((a.grids.size() >= 1u && a.grids.size() <= kMaxOctahedraGrids));
  const uint32_t rays = hostCount(a.rays);
  const auto trace = HWY_DYNAMIC_DISPATCH(traceRays);
  const TracedOctahedra all(a);
  uint32_t* const firstSample = hostPointer(a.firstSample);
  const size_t tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  thread_local std::vector<TaskHits> hitsOfTask;  // keeps its memory for the next rays
  if (hitsOfTask.size() < tasks) hitsOfTask.resize(tasks);
  context.pool.run(tasks, [&, allHits = hitsOfTask.data()](size_t task, int) {
    thread_local TraceScratch scratch;
    scratch.makeRoomFor(a.grids[0].resolution);
    TaskHits& hits = allHits[task];
    hits.clear();
    hits.makeRoomFor(kRaysPerTask * kExpectedHits / 2);
    const uint32_t begin = static_cast<uint32_t>(task * kRaysPerTask);
    const uint32_t end = static_cast<uint32_t>(std::min<size_t>(rays, (task + 1) * kRaysPerTask));
    trace(all, begin, end, scratch, hits, firstSample + begin + 1);
  });
  const uint32_t finished = countsToOffsets(firstSample, rays, a.sampleCapacity);
  *hostPointer(a.sampleCount) = firstSample[rays];
  if (a.finishedRays) *hostPointer(a.finishedRays) = finished;
  context.pool.run(tasks, [&, allHits = hitsOfTask.data()](size_t task, int) {
    const TaskHits& hits = allHits[task];
    const size_t begin = task * kRaysPerTask, end = std::min<size_t>(rays, (task + 1) * kRaysPerTask);
    const size_t row = firstSample[begin], count = firstSample[end] - row;
    if (a.rayOfSample)
      for (size_t ray = begin; ray < end; ++ray)
        std::fill(hostPointer(a.rayOfSample) + firstSample[ray], hostPointer(a.rayOfSample) + firstSample[ray + 1],
                  static_cast<uint32_t>(ray));
    std::copy_n(hits.faces.data(), count, hostPointer(a.faces) + row);
    std::copy_n(hits.barycentrics.data(), 2 * count, hostPointer(a.barycentrics) + 2 * row);
    std::copy_n(hits.positions.data(), 3 * count, hostPointer(a.positions) + 3 * row);
    std::copy_n(hits.distances.data(), count, hostPointer(a.distances) + row);
  });
}

}  // namespace tessera::cpu
#endif
