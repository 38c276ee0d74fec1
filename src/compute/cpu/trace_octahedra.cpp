// Hits of rays on grids of octahedra on the CPU. A ray walks through the cells of a grid and, in each occupied cell, is
// tested against all faces that can reach into that cell: those of the octahedra among the 27 cells around it. Hits
// outside the cell are dropped, so that no face is hit twice and cells can be skipped. As vertices never leave their
// cells, nothing is missed but for rounding at the walls, and hits are sorted within a cell only.
//
// Several rays walk at a time, one per lane, and list the occupied cells that they cross; then each ray is tested in
// its cells, several faces at a time. The test is that of Woop et al. 2013 (ray/triangle intersection): the 27 vertices
// are sheared once so that the ray becomes the z axis; a face then needs three cross products. Rays and cells are
// computed in double, and the faces in float relative to the point at which the ray enters the cell.

#include "compute/cpu/trace_octahedra.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/cpu/offsets.h"
#include "compute/host_memory.h"
#include "compute/octahedra.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/trace_octahedra.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/highway.h>

#include "compute/cpu/octahedra_vertices-inl.h"
#include "compute/cpu/octahedra_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

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
constexpr size_t kRaysPerTask = 64;   // fixed; the hits of all tasks are concatenated in task order

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
