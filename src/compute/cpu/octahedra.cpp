// Octahedra grids on the CPU. A ray walks through the cells of the grid and, in each occupied cell, is tested against
// all faces that can reach into that cell: those of the octahedra among the 27 cells around it. Hits outside the cell
// are dropped, so that no face is hit twice and cells can be skipped. As vertices never leave their cells, nothing is
// missed but for rounding at the walls, and hits are sorted within a cell only.
//
// The test is that of Woop et al. 2013 (ray/triangle intersection): the 27 vertices are sheared once so that
// the ray becomes the z axis; a face then needs three cross products. All faces are tested in vectors. The ray and the
// cells are computed in double, and the faces in float relative to the point at which the ray enters the cell.

#include "compute/octahedra.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <utility>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/cpu/offsets.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/octahedra.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

#ifndef TESSERA_CPU_OCTAHEDRA_ONCE
#define TESSERA_CPU_OCTAHEDRA_ONCE
namespace tessera::cpu {

inline constexpr int kVertices = 27;          // of the cells around a cell; dx + 1 + 3 (dy + 1) + 9 (dz + 1)
inline constexpr int kSlots = 32;             // two vectors of 16; slots without a vertex hold NaN
inline constexpr int kMaxCandidates = 112;    // a multiple of 16
inline constexpr size_t kMaxHitsInCell = 64;  // the nearest are kept

// The cell of a slot's vertex relative to the middle one; slots without a vertex hold NaN.
struct SlotOffsets {
  alignas(64) float at[3][kSlots] = {};

  constexpr SlotOffsets() {
    for (int slot = 0; slot < kSlots; ++slot) {
      const int offsets[3] = {slot % 3 - 1, slot / 3 % 3 - 1, slot / 9 - 1};
      for (int axis = 0; axis < 3; ++axis)
        at[axis][slot] = slot < kVertices ? static_cast<float>(offsets[axis]) : std::numeric_limits<float>::quiet_NaN();
    }
  }
};
inline constexpr SlotOffsets kSlotOffsets;

// The faces that can reach into a cell.
struct Candidates {
  int count = 0;                                     // a multiple of 16; those of no face have slots without a vertex
  alignas(64) int32_t slot[3][kMaxCandidates] = {};  // the slots of the three vertices
  int8_t cell[kMaxCandidates][3] = {};               // of the octahedron, relative to the cell
  uint8_t local[kMaxCandidates] = {};                // number within the octahedron
};

inline Candidates makeCandidates(OctahedraPlacement placement, uint32_t parity) {
  Candidates all;
  for (const ReachingFace& face : reachingFaces(placement, parity)) {
    const auto corners = octahedronFace(face.local);
    for (int corner = 0; corner < 3; ++corner) {
      int32_t slot = 0, stride = 1;
      for (int axis = 0; axis < 3; ++axis) {
        slot += stride * (face.octahedron[axis] + corners[corner][axis] + 1);
        stride *= 3;
      }
      all.slot[corner][all.count] = slot;
    }
    for (int axis = 0; axis < 3; ++axis) all.cell[all.count][axis] = static_cast<int8_t>(face.octahedron[axis]);
    all.local[all.count++] = static_cast<uint8_t>(face.local);
  }
  for (; all.count % 16 != 0; ++all.count) {
    for (auto& slots : all.slot) slots[all.count] = kVertices;
  }
  return all;
}

inline const Candidates& selectCandidates(OctahedraPlacement placement, uint32_t parity) {
  static const Candidates every = makeCandidates(OctahedraPlacement::all, 0);
  static const Candidates even = makeCandidates(OctahedraPlacement::checkerboard, 0);
  static const Candidates odd = makeCandidates(OctahedraPlacement::checkerboard, 1);
  if (placement == OctahedraPlacement::all) return every;
  return parity % 2 == 0 ? even : odd;
}

// Which blocks of 4³ cells hold an occupied cell, so that rays cross the others at once.
class OccupiedBlocks {
 public:
  static constexpr int kEdge = 4;

  OccupiedBlocks(OctahedraGrids grids, const uint32_t* occupancy)
      : blocks_((grids[0].resolution + kEdge - 1) / kEdge),
        isOccupied_(size_t{blocks_} * blocks_ * blocks_ * grids.size()) {
    const uint32_t n = grids[0].resolution, words = grids[0].words();
    for (size_t word = 0; word < words * grids.size(); ++word) {
      for (uint32_t bits = occupancy[word]; bits != 0; bits &= bits - 1) {
        const uint32_t cell = static_cast<uint32_t>(word % words) * 32 + static_cast<uint32_t>(std::countr_zero(bits));
        const uint32_t at[3] = {cell % n / kEdge, cell / n % n / kEdge, cell / (n * n) / kEdge};
        isOccupied_[word / words * blocks_ * blocks_ * blocks_ + at[0] + blocks_ * (at[1] + size_t{blocks_} * at[2])] =
            1;
      }
    }
  }
  // Of one grid; block (i, j, k) at i + blocks() (j + blocks() k).
  const uint8_t* inGrid(uint32_t grid) const { return isOccupied_.data() + size_t{grid} * blocks_ * blocks_ * blocks_; }
  int blocks() const { return static_cast<int>(blocks_); }

 private:
  uint32_t blocks_;
  std::vector<uint8_t> isOccupied_;
};

struct OctahedraHit {
  uint32_t ray, face;
  float barycentrics[2], position[3], distance;
};

// A ray in homogeneous coordinates of the grid: start + t · slope.
struct HomogeneousRay {
  double start[4], slope[4];

  HomogeneousRay(const OctahedraGrid& grid, const float* origin, const float* direction) {
    for (int row = 0; row < 4; ++row) {
      const float* const m = grid.gridFromScene.data() + 4 * row;
      start[row] = m[3];
      slope[row] = 0;
      for (int column = 0; column < 3; ++column) {
        start[row] += double{m[column]} * origin[column];
        slope[row] += double{m[column]} * direction[column];
      }
    }
  }
  // Limits [*begin, *end] to the box in which faces are hit. All six bounds are linear in t.
  void clip(const OctahedraGrid& grid, double* begin, double* end) const {
    for (int axis = 0; axis < 3; ++axis) {
      const double low = std::max(0.0f, grid.lowest[axis]);
      const double high = std::min(static_cast<float>(grid.resolution), grid.highest[axis]);
      for (const bool upper : {false, true}) {
        const double value = upper ? high * start[3] - start[axis] : start[axis] - low * start[3];
        const double rise = upper ? high * slope[3] - slope[axis] : slope[axis] - low * slope[3];
        if (rise > 0) {
          *begin = std::max(*begin, -value / rise);
        } else if (rise < 0) {
          *end = std::min(*end, -value / rise);
        } else if (value < 0) {
          *end = -std::numeric_limits<double>::infinity();
        }
      }
    }
  }
  double at(double t, int axis) const { return (start[axis] + t * slope[axis]) / (start[3] + t * slope[3]); }
  // The parameter at which a coordinate has the value g.
  double parameterAt(double g, int axis) const { return (g * start[3] - start[axis]) / (slope[axis] - g * slope[3]); }
};

// Returns the distance at which a ray leaves TraceOctahedra::boxInFront, or 0 if it does not cross it.
inline double distanceBehindBox(const std::array<float, 3>& halfEdges, const float* origin, const float* direction) {
  if (halfEdges == std::array<float, 3>{}) return 0;
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (std::abs(origin[axis]) > halfEdges[axis]) return 0;
      continue;
    }
    const double side = std::copysign(double{halfEdges[axis]}, double{direction[axis]});
    enter = std::max(enter, (-side - origin[axis]) / direction[axis]);
    leave = std::min(leave, (side - origin[axis]) / direction[axis]);
  }
  return enter < leave ? leave : 0;
}

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Float = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Float>;

// A table of kSlots numbers.
struct Table {
#if HWY_TARGET == HWY_AVX3
  Vector low, high;

  explicit HWY_INLINE Table(const float* values)
      : low(hn::Load(Float(), values)), high(hn::Load(Float(), values + 16)) {}
  // Highway 1.0 has no lookup in two vectors.
  HWY_INLINE Vector lookup(const int32_t* slots) const {
    return Vector{_mm512_permutex2var_ps(low.raw, _mm512_load_si512(slots), high.raw)};
  }
#else
  const float* values;

  explicit HWY_INLINE Table(const float* all) : values(all) {}
  HWY_INLINE Vector lookup(const int32_t* slots) const {
    alignas(64) float gathered[16];
    for (size_t i = 0; i < hn::Lanes(Float()); ++i) gathered[i] = values[slots[i]];
    return hn::Load(Float(), gathered);
  }
#endif
};

// The walk of one ray through the cells of a grid, in grid coordinates: g = entry + s · step, where the farthest
// coordinate advances by 1 per unit of s.
class Walk {
 public:
  // The ray gets hits at distances in (near, far). `first`: the first one of the ray in `hits`.
  Walk(const TraceOctahedra& a, const OccupiedBlocks& blocks, uint32_t grid, uint32_t ray, double near, double far,
       size_t first, std::vector<OctahedraHit>& hits)
      : a_(a),
        grid_(a.grids[grid]),
        firstCell_(grid * grid_.cells()),
        ray_(ray),
        hits_(hits),
        first_(first),
        line_(grid_, hostPointer(a.origins) + 3 * size_t{ray}, hostPointer(a.directions) + 3 * size_t{ray}),
        displacements_(hostPointer(a.displacements) + size_t{3} * firstCell_),
        occupancy_(hostPointer(a.occupancy) + size_t{grid} * grid_.words()),
        blocks_(blocks.inGrid(grid)),
        keptFaces_(hostPointer(a.keptFaces)),
        blocksAlong_(blocks.blocks()),
        n_(static_cast<int>(grid_.resolution)),
        near_(near),
        far_(far) {
    line_.clip(grid_, &near_, &far_);
  }

  bool meetsGrid() const { return near_ < far_; }
  double near() const { return near_; }

  // Returns false if the ray has all hits that it may have.
  bool run() {
    std::fill(std::begin(around_), std::end(around_), 0.0f);
    const double begin = near_, end = far_;
    double direction[3], largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      direction[axis] = line_.slope[axis] * line_.start[3] - line_.start[axis] * line_.slope[3];
      if (std::abs(direction[axis]) > largest) {
        largest = std::abs(direction[axis]);
        z_ = axis;
      }
    }
    if (!(largest > 0)) return true;
    x_ = (z_ + 1) % 3;
    y_ = (z_ + 2) % 3;
    int cell[3];
    double next[3];
    for (int axis = 0; axis < 3; ++axis) {
      step_[axis] = direction[axis] / largest;
      entry_[axis] = std::clamp(line_.at(begin, axis), 0.0, double{static_cast<double>(n_)});
      cell[axis] = std::min(static_cast<int>(entry_[axis]), n_ - 1);
      // On a wall between two cells, the ray is in the one that it enters.
      if (step_[axis] < 0 && cell[axis] > 0 && entry_[axis] == cell[axis]) --cell[axis];
    }
    const double last = std::abs(line_.at(end, z_) - entry_[z_]);
    const auto wall = [&](int axis) {
      if (step_[axis] == 0) return std::numeric_limits<double>::infinity();
      return (cell[axis] + (step_[axis] > 0 ? 1 : 0) - entry_[axis]) / step_[axis];
    };
    for (int axis = 0; axis < 3; ++axis) next[axis] = wall(axis);
    double s = 0;
    constexpr int kEdge = OccupiedBlocks::kEdge;
    for (;;) {
      const int block[3] = {cell[0] / kEdge, cell[1] / kEdge, cell[2] / kEdge};
      if (blocks_[block[0] + blocksAlong_ * (block[1] + int64_t{blocksAlong_} * block[2])] == 0) {
        // To the cell beyond the wall of the block. Along the other axes, rounding may choose the neighbour of a cell
        // at its wall: the ray then leaves that cell where it entered it.
        double leave = std::numeric_limits<double>::infinity();
        int through = 0;
        for (int axis = 0; axis < 3; ++axis) {
          if (step_[axis] == 0) continue;
          const double at = (kEdge * (block[axis] + (step_[axis] > 0 ? 1 : 0)) - entry_[axis]) / step_[axis];
          if (at < leave) {
            leave = at;
            through = axis;
          }
        }
        if (!(leave < last)) return true;
        s = std::max(s, leave);
        for (int axis = 0; axis < 3; ++axis) {
          const int first = kEdge * block[axis];
          if (axis == through) {
            cell[axis] = step_[axis] > 0 ? first + kEdge : first - 1;
            if (cell[axis] < 0 || cell[axis] >= n_) return true;
          } else {
            cell[axis] =
                std::clamp(static_cast<int>(entry_[axis] + s * step_[axis]), first, std::min(first + kEdge, n_) - 1);
          }
        }
        for (int axis = 0; axis < 3; ++axis) next[axis] = wall(axis);
        continue;
      }
      int axis = next[1] < next[0] ? 1 : 0;
      if (next[2] < next[axis]) axis = 2;
      const double leave = next[axis];
      const uint32_t index = static_cast<uint32_t>(cell[0] + n_ * (cell[1] + n_ * cell[2]));
      if ((occupancy_[index / 32] >> index % 32 & 1) != 0 && !addHits(cell, index, s, leave)) return false;
      if (!(leave < last)) return true;
      s = std::max(s, leave);
      cell[axis] += step_[axis] > 0 ? 1 : -1;
      if (cell[axis] < 0 || cell[axis] >= n_) return true;
      next[axis] = wall(axis);
    }
  }

 private:
  struct Near {
    double s;
    uint32_t face;
    float barycentrics[2];
    bool operator<(const Near& other) const { return s != other.s ? s < other.s : face < other.face; }
  };

  // Writes the vertices of the cells around `cell` relative to the ray at `s`, sheared so that the ray is the z axis.
  void HWY_INLINE shear(const int cell[3], double s) {
    const float shearX = static_cast<float>(step_[x_] / step_[z_]), shearY = static_cast<float>(step_[y_] / step_[z_]);
    const float sign = step_[z_] > 0 ? 1.0f : -1.0f;
    float origin[3];  // of the ray, relative to the centre of the cell
    for (int axis = 0; axis < 3; ++axis)
      origin[axis] = static_cast<float>(entry_[axis] + s * step_[axis] - (cell[axis] + 0.5));
    const auto isBeyond = [&](int at) { return static_cast<uint32_t>(at) >= static_cast<uint32_t>(n_); };
    const bool inside =
        cell[0] > 0 && cell[1] > 0 && cell[2] > 0 && cell[0] < n_ - 1 && cell[1] < n_ - 1 && cell[2] < n_ - 1;
    for (int row = 0; row < 9; ++row) {
      const int y = cell[1] + row % 3 - 1, z = cell[2] + row / 3 - 1;
      const float* const from = displacements_ + 3 * (cell[0] - 1 + int64_t{n_} * (y + int64_t{n_} * z));
      float* const to = around_ + 9 * row;
      if (inside) {
        std::memcpy(to, from, 9 * sizeof(float));
        continue;
      }
      for (int i = 0; i < 3; ++i) {
        const bool exists = !isBeyond(cell[0] - 1 + i) && !isBeyond(y) && !isBeyond(z);
        for (int axis = 0; axis < 3; ++axis)
          to[3 * i + axis] = exists ? from[3 * i + axis] : std::numeric_limits<float>::quiet_NaN();
      }
    }
    const Float d;
    for (int slot = 0; slot < kSlots; slot += static_cast<int>(hn::Lanes(d))) {
      Vector at[3];
      hn::LoadInterleaved3(d, around_ + 3 * slot, at[0], at[1], at[2]);
      for (int axis = 0; axis < 3; ++axis)
        at[axis] = hn::Sub(hn::Add(hn::Load(d, kSlotOffsets.at[axis] + slot), at[axis]), hn::Set(d, origin[axis]));
      hn::Store(hn::NegMulAdd(hn::Set(d, shearX), at[z_], at[x_]), d, sheared_[0] + slot);
      hn::Store(hn::NegMulAdd(hn::Set(d, shearY), at[z_], at[y_]), d, sheared_[1] + slot);
      hn::Store(hn::Mul(at[z_], hn::Set(d, sign)), d, sheared_[2] + slot);
    }
  }

  // Adds the hits of a cell that the ray crosses from s = `enter` to `leave`; false if the ray has all that it may
  // have.
  bool addHits(const int cell[3], uint32_t index, double enter, double leave) {
    shear(cell, enter);
    const Candidates& faces = selectCandidates(grid_.placement, static_cast<uint32_t>(cell[0] + cell[1] + cell[2]));
    const Float d;
    const Vector zero = hn::Zero(d);
    const Table tableX(sheared_[0]), tableY(sheared_[1]);
    alignas(64) float edges[3][16];
    Near near[kMaxHitsInCell];
    size_t hitCount = 0;
    for (int first = 0; first < faces.count; first += static_cast<int>(hn::Lanes(d))) {
      const Vector ax = tableX.lookup(faces.slot[0] + first), ay = tableY.lookup(faces.slot[0] + first);
      const Vector bx = tableX.lookup(faces.slot[1] + first), by = tableY.lookup(faces.slot[1] + first);
      const Vector cx = tableX.lookup(faces.slot[2] + first), cy = tableY.lookup(faces.slot[2] + first);
      // Twice the signed areas of the ray with each edge: the barycentric coordinates of the opposite vertices.
      const Vector u = hn::MulSub(bx, cy, hn::Mul(by, cx)), v = hn::MulSub(cx, ay, hn::Mul(cy, ax)),
                   w = hn::MulSub(ax, by, hn::Mul(ay, bx));
      const Vector smallest = hn::Min(u, hn::Min(v, w)), largest = hn::Max(u, hn::Max(v, w));
      // NaN compares false, but Min and Max may drop it: the sum keeps it.
      const Vector sum = hn::Add(u, hn::Add(v, w));
      const auto hit =
          hn::And(hn::Ne(sum, zero), hn::And(hn::Or(hn::Ge(smallest, zero), hn::Le(largest, zero)), hn::Eq(sum, sum)));
      uint8_t bytes[8] = {};
      hn::StoreMaskBits(d, hit, bytes);
      uint32_t mask = bytes[0] | uint32_t{bytes[1]} << 8;
      if (mask == 0) continue;
      hn::Store(u, d, edges[0]);
      hn::Store(v, d, edges[1]);
      hn::Store(w, d, edges[2]);
      for (; mask != 0; mask &= mask - 1) {
        const int lane = __builtin_ctz(mask), face = first + lane;
        const float total = edges[0][lane] + edges[1][lane] + edges[2][lane];
        float z = 0;
        for (int corner = 0; corner < 3; ++corner) z += edges[corner][lane] * sheared_[2][faces.slot[corner][face]];
        const double s = enter + double{z / total};
        if (!(s >= enter && s < leave)) continue;
        const int8_t* const offset = faces.cell[face];
        const uint32_t octahedron = index + static_cast<uint32_t>(offset[0] + n_ * (offset[1] + n_ * offset[2]));
        const uint32_t number = (firstCell_ + octahedron) * kFacesPerCell + faces.local[face];
        if (keptFaces_ && (keptFaces_[number / 32] >> number % 32 & 1) == 0) continue;
        const Near one{s, number, {edges[1][lane] / total, edges[2][lane] / total}};
        if (hitCount == kMaxHitsInCell && !(one < near[hitCount - 1])) continue;
        size_t place = hitCount < kMaxHitsInCell ? hitCount++ : hitCount - 1;
        for (; place > 0 && one < near[place - 1]; --place) near[place] = near[place - 1];
        near[place] = one;
      }
    }
    for (size_t i = 0; i < hitCount; ++i) {
      const Near& one = near[i];
      OctahedraHit hit{ray_, one.face, {one.barycentrics[0], one.barycentrics[1]}, {}, 0};
      const double distance = line_.parameterAt(entry_[z_] + one.s * step_[z_], z_);
      if (!(distance > near_ && distance < far_)) continue;
      hit.distance = static_cast<float>(distance);
      for (int axis = 0; axis < 3; ++axis)
        hit.position[axis] = std::clamp(
            static_cast<float>(entry_[axis] + one.s * step_[axis] + grid_.positionOffset[axis]) * grid_.positionScale(),
            0.0f, 1.0f);
      hits_.push_back(hit);
      if (hits_.size() - first_ >= a_.maximum) return false;
    }
    return true;
  }

  const TraceOctahedra& a_;
  const OctahedraGrid& grid_;
  uint32_t firstCell_;  // of the grid
  uint32_t ray_;
  std::vector<OctahedraHit>& hits_;
  size_t first_;  // of the ray in hits_
  HomogeneousRay line_;
  const float* displacements_;  // of the grid
  const uint32_t* occupancy_;
  const uint8_t* blocks_;
  const uint32_t* keptFaces_;                    // of all grids; null: all are
  int blocksAlong_, n_, x_ = 0, y_ = 1, z_ = 2;  // z_: the axis along which the ray is longest
  double near_, far_, entry_[3] = {}, step_[3] = {};
  alignas(64) float around_[3 * kSlots], sheared_[3][kSlots];  // the vertices' displacements; see shear
};

void traceRay(const TraceOctahedra& a, const OccupiedBlocks& blocks, uint32_t ray, std::vector<OctahedraHit>& hits) {
  const float* const direction = hostPointer(a.directions) + 3 * size_t{ray};
  if (a.maximum == 0 || (direction[0] == 0 && direction[1] == 0 && direction[2] == 0)) return;
  const double near =
      std::max(double{a.near}, distanceBehindBox(a.boxInFront, hostPointer(a.origins) + 3 * size_t{ray}, direction));
  const double far = a.farOfRay ? std::min(1e30, double{hostPointer(a.farOfRay)[ray]}) : 1e30;
  const size_t first = hits.size();
  // The boxes of the grids are convex and do not overlap, so that a ray crosses them one after another.
  std::array<std::pair<double, uint32_t>, kMaxOctahedraGrids> order;
  size_t count = 0;
  for (uint32_t grid = 0; grid < a.grids.size(); ++grid) {
    const Walk walk(a, blocks, grid, ray, near, far, first, hits);
    if (!walk.meetsGrid()) continue;
    size_t place = count++;
    for (; place > 0 && walk.near() < order[place - 1].first; --place) order[place] = order[place - 1];
    order[place] = {walk.near(), grid};
  }
  for (size_t i = 0; i < count; ++i)
    if (!Walk(a, blocks, order[i].second, ray, near, far, first, hits).run()) return;
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(traceRay);

namespace {

constexpr size_t kExpectedHits = 16;  // of a ray; more are only slower
constexpr size_t kRaysPerTask = 64;   // fixed; the hits of all tasks are concatenated in task order

// A face's vertices, and where they lie in their grid.
struct FaceVertices {
  uint32_t cell[3];
  double at[3][3];

  FaceVertices(const OctahedraGrid& grid, const float* displacements, uint32_t face) {
    const uint32_t n = grid.resolution, cells = grid.cells(), firstCell = face / kFacesPerCell / cells * cells;
    const uint32_t octahedron = face / kFacesPerCell - firstCell;
    const int centre[3] = {static_cast<int>(octahedron % n), static_cast<int>(octahedron / n % n),
                           static_cast<int>(octahedron / (n * n))};
    const auto corners = octahedronFace(face % kFacesPerCell);
    for (int corner = 0; corner < 3; ++corner) {
      uint32_t stride = 1;
      cell[corner] = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const int place = centre[axis] + corners[corner][axis];
        at[corner][axis] = place + 0.5;
        cell[corner] += stride * static_cast<uint32_t>(place);
        stride *= n;
      }
      cell[corner] += firstCell;
      for (int axis = 0; axis < 3; ++axis) at[corner][axis] += displacements[3 * size_t{cell[corner]} + axis];
    }
  }
};

// The face's normal, scaled so that a vertex's gradient is this times its barycentric coordinate.
void scaledNormal(const OctahedraBackward& a, uint32_t sample, float out[3]) {
  const uint32_t number = hostPointer(a.faces)[sample];
  const OctahedraGrid& grid = a.grids[number / kFacesPerCell / a.grids[0].cells()];
  const FaceVertices face(grid, hostPointer(a.displacements), number);
  const size_t ray = hostPointer(a.rayOfSample)[sample];
  const HomogeneousRay line(grid, hostPointer(a.origins) + 3 * ray, hostPointer(a.directions) + 3 * ray);
  const double t = hostPointer(a.distances)[sample], scale = line.start[3] + t * line.slope[3];
  double normal[3], slope[3], across = 0, along = 0, normalSquare = 0, slopeSquare = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int x = (axis + 1) % 3, y = (axis + 2) % 3;
    normal[axis] = (face.at[1][x] - face.at[0][x]) * (face.at[2][y] - face.at[0][y]) -
                   (face.at[1][y] - face.at[0][y]) * (face.at[2][x] - face.at[0][x]);
    slope[axis] = (line.slope[axis] - line.at(t, axis) * line.slope[3]) / scale;
    across += normal[axis] * slope[axis];
    along += slope[axis] * hostPointer(a.positionGradients)[3 * size_t{sample} + axis];
    normalSquare += normal[axis] * normal[axis];
    slopeSquare += slope[axis] * slope[axis];
  }
  across = std::copysign(std::max(std::abs(across), a.minCosine * std::sqrt(normalSquare * slopeSquare)), across);
  along *= grid.positionScale();
  if (a.distanceGradients) along += hostPointer(a.distanceGradients)[sample];
  for (int axis = 0; axis < 3; ++axis)
    out[axis] = across == 0 ? 0.0f : static_cast<float>(along / across * normal[axis]);
}

}  // namespace

void run(Context& context, const TraceOctahedra& a) {
  CHECK((a.grids.size() >= 1u && a.grids.size() <= kMaxOctahedraGrids));
  const uint32_t rays = hostCount(a.rays);
  const auto trace = HWY_DYNAMIC_DISPATCH(traceRay);
  const OccupiedBlocks blocks(a.grids, hostPointer(a.occupancy));
  uint32_t* const firstSample = hostPointer(a.firstSample);
  const size_t tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  std::vector<std::vector<OctahedraHit>> hitsOfTask(tasks);
  context.pool.run(tasks, [&](size_t task, int) {
    std::vector<OctahedraHit>& hits = hitsOfTask[task];
    hits.reserve(kRaysPerTask * kExpectedHits);
    for (size_t ray = task * kRaysPerTask; ray < std::min<size_t>(rays, (task + 1) * kRaysPerTask); ++ray) {
      const size_t before = hits.size();
      trace(a, blocks, static_cast<uint32_t>(ray), hits);
      firstSample[ray + 1] = static_cast<uint32_t>(hits.size() - before);
    }
  });
  const uint32_t finished = countsToOffsets(firstSample, rays, a.sampleCapacity);
  *hostPointer(a.sampleCount) = firstSample[rays];
  if (a.finishedRays) *hostPointer(a.finishedRays) = finished;
  context.pool.run(tasks, [&](size_t task, int) {
    const size_t first = task * kRaysPerTask;
    for (size_t i = 0; i < hitsOfTask[task].size(); ++i) {
      const OctahedraHit& hit = hitsOfTask[task][i];
      if (hit.ray >= finished) break;
      const size_t row = firstSample[first] + i;
      if (a.rayOfSample) hostPointer(a.rayOfSample)[row] = hit.ray;
      hostPointer(a.faces)[row] = hit.face;
      std::copy_n(hit.barycentrics, 2, hostPointer(a.barycentrics) + 2 * row);
      std::copy_n(hit.position, 3, hostPointer(a.positions) + 3 * row);
      hostPointer(a.distances)[row] = hit.distance;
    }
  });
}

void run(Context& context, const OctahedraBackward& a) {
  const uint32_t samples = hostCount(a.samples);
  std::vector<float> normals(size_t{3} * samples);
  context.pool.forRanges(samples, 1024, [&](size_t begin, size_t end) {
    for (size_t sample = begin; sample < end; ++sample)
      scaledNormal(a, static_cast<uint32_t>(sample), &normals[3 * sample]);
  });
  // One thread adds, because samples share vertices; this is a small part of the work.
  float* const sums = hostPointer(a.displacementGradients);
  const float* const barycentrics = hostPointer(a.barycentrics);
  for (size_t sample = 0; sample < samples; ++sample) {
    const FaceVertices face(a.grids[0], hostPointer(a.displacements), hostPointer(a.faces)[sample]);
    const float second = barycentrics[2 * sample], third = barycentrics[2 * sample + 1];
    const float shares[3] = {1 - second - third, second, third};
    for (int corner = 0; corner < 3; ++corner) {
      float* const to = sums + 3 * size_t{face.cell[corner]};
      for (int axis = 0; axis < 3; ++axis) to[axis] += shares[corner] * normals[3 * sample + axis];
    }
  }
}

void run(Context& context, const MergeOctahedra& a) {
  const uint32_t n = a.resolution, coarse = n / 2;
  CHECK(n % 2 == 0u);
  const size_t listed = a.cells.count;
  const uint32_t* const cells = hostPointer(a.cells);
  const float* const x = hostPointer(a.x.data);
  float* const opacities = hostPointer(a.opacities);
  std::fill_n(opacities, size_t{n} * n * n, 0.0f);
  context.pool.forRanges(listed, 1024, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float sum = 0;
      for (size_t p = 0; p < a.points; ++p) sum += 1 / (1 + std::exp(-x[a.x.offset(p * listed + i, 0)] - a.offset));
      opacities[cells[i]] = sum / static_cast<float>(a.points);
    }
  });
  const float* const displacements = hostPointer(a.displacements);
  float* const merged = hostPointer(a.mergedDisplacements);
  context.pool.forRanges(size_t{coarse} * coarse * coarse, 1024, [&](size_t begin, size_t end) {
    for (size_t cell = begin; cell < end; ++cell) {
      const size_t place[3] = {cell % coarse, cell / coarse % coarse, cell / (size_t{coarse} * coarse)};
      float largest = MergeOctahedra::kTransparent;
      std::fill_n(merged + 3 * cell, 3, 0.0f);
      for (size_t child = 0; child < 8; ++child) {
        const size_t side[3] = {child & 1, child >> 1 & 1, child >> 2};
        const size_t fine = 2 * place[0] + side[0] + n * (2 * place[1] + side[1] + n * (2 * place[2] + side[2]));
        if (!(opacities[fine] > largest)) continue;
        largest = opacities[fine];
        for (int axis = 0; axis < 3; ++axis)
          merged[3 * cell + axis] = 0.5f * (static_cast<float>(side[axis]) - 0.5f + displacements[3 * fine + axis]);
      }
    }
  });
}

}  // namespace tessera::cpu
#endif
