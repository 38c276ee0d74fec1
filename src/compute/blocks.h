// A scene cut into square blocks on the ground (City-on-Web, section 4.1), and samples along rays through it.
#pragma once

#include <array>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// What becomes of all that lies outside the region of interest.
//   none     nothing is there
//   border   blocks at the border own the half-strips and quadrants outside and are contracted (the paper)
//   own      one more block, contracted, owns it; the blocks keep their whole resolution for the region. It is seen
//            behind the region only: rays begin where they enter the box
enum class Surround { none, border, own };

// Scene units: half a block's edge is 1, the origin is the middle of all blocks. The box is [-columns, columns] ×
// [-rows, rows] × [bottom, top]. Block (i, j) is i + columns · j and holds x in [2i - columns, 2i + 2 - columns], y
// likewise; blocks are convex and do not overlap.
struct BlockSpace {
  uint32_t columns = 1, rows = 1;
  float bottom = -1, top = 1;  // in [-1,1]
  float near = 0.05f;          // no sample nearer to a camera
  Surround surround = Surround::own;

  uint32_t cells() const { return columns * rows; }
  uint32_t blocks() const { return cells() + (surround == Surround::own ? 1 : 0); }  // the surround is the last

  // Local coordinates are q = (x - centre) / scale per axis: of a cell scale 1 about its middle, (2i + 1 - columns,
  // 2j + 1 - rows, 0); of the surround scale (columns, rows, 1) about the origin. A bounded block's domain is [-1,1]³
  // and holds q; a contracted one's is [-2,2]³ and holds scene/contraction.h of q.
  struct Placement {
    float centre[3] = {0, 0, 0}, scale[3] = {1, 1, 1};
    bool contracted = false;
    float halfDomain() const { return contracted ? 2.0f : 1.0f; }
  };
  Placement placement(uint32_t block) const;

  // What a block owns, to kFarthest where that has no end: of the surround all, as it is seen behind the box only.
  struct Box {
    std::array<float, 3> low, high;
  };
  Box owned(uint32_t block) const;

  // Where a ray is in the box, from `near` on.
  struct Range {
    double near = 0, far = 0;
    bool empty() const { return !(near < far); }
  };
  Range rangeInBox(const std::array<double, 3>& origin, const std::array<double, 3>& direction, double near) const;

  // The cell of x and y, clamped; with an own surround that one for every point outside the box.
  uint32_t blockAt(double x, double y, double z) const;

  // Along a ray whose box is [near, far]: s in [0,1] to distance t. With a surround, s in [0, 3/4] is linear over the
  // box and s in (3/4, 1] linear in 1/t from there to kFarthest; without, s is linear over the box.
  static constexpr double kBoxShare = 0.75, kFarthest = 1e6;
  double distanceAt(double s, double near, double far) const;
  double shareAt(double t, double near, double far) const;  // s, its inverse
};

// In tables from blocks to slots: the block is not in memory. A scene that is trained a few blocks at a time holds
// those in slots; rows of samples then name slots.
inline constexpr uint32_t kNoSlot = UINT32_MAX;

// Where rays enter and leave the box, and their first fence posts. Range: [max(near, entry), exit]; where that is empty
// [near, near + 1 + distance of the origin to the ray's own origin] with a surround, [near, near] without. Fences: 0,
// (i + jitter - ½) / intervals for i in (0, intervals), 1. `near` is the space's, or the ray's own where that is
// farther.
struct EnterScene {
  const BlockSpace& space;
  Count rays;
  uint32_t intervals = 64;
  Slice<const float> origins;     // [rays][3]
  Slice<const float> directions;  // [rays][3], unit; zero: no ray, range [near, near]
  Slice<const float> jitter;      // optional, [rays], in [0,1); else ½
  Slice<const float> nearOfRay;   // optional, [rays]
  Slice<float> range;             // [rays][2]
  Slice<float> fences;            // [rays][intervals + 1]
};
TESSERA_OPERATION(EnterScene);

// Intervals between fence posts become samples at their middles (in t). Rows are written from `firstRow` on, ray after
// ray, front to back. With `split`, intervals are cut where the ray passes from one block to another: at every distance
// where its x or y is that of an inner cell wall, and with an own surround where it leaves the box (range[1]), if that
// lies strictly inside an interval (in s); so no sample straddles two blocks. The samples of a ray in one block are
// then a segment. A sample belongs to the block of its middle. Positions are in [0,1]³ over the block's domain; a
// sample outside the domain of a bounded block (above or below an inner cell of a grid whose border is contracted)
// keeps its row with step 0 and its position clamped. Ends beyond `farOfRay` are cut off there: steps shrink, to 0
// behind it; middles stay. Work in double; a ray without direction is not cut, its steps and runtime steps are 0.
// With `slotOfBlock`, blocks are named by their slots in all that is written; a sample in a block without one keeps its
// row with slot 0 and step 0.
struct BlockSamples {
  const BlockSpace& space;
  Count rays;
  uint32_t intervals = 64;
  bool split = false;
  uint32_t firstRow = 0;
  Slice<const float> origins, directions;  // [rays][3]
  Slice<const float> range;                // [rays][2]
  Slice<const float> farOfRay;             // optional, [rays]
  Slice<const float> fences;               // [rays][intervals + 1], s, increasing
  // Room for firstRow + mostSamples(rays) rows.
  Slice<uint32_t> firstSample;  // [rays + 1]: absolute rows
  Slice<uint32_t> rowCount;     // [1]: firstRow + samples made
  // Per sample:
  Slice<uint32_t> blockOfSample;
  Slice<float> positions;     // [rows][3]
  Slice<float> distances;     // t of the middle
  Slice<float> steps;         // length in t
  Slice<float> middles;       // optional: the mean of both ends in s
  Slice<float> widths;        // optional: length in s
  Slice<float> runtimeSteps;  // optional: length in t of a renderer's step here along the ray: one texel of the domain,
                              // which is 2 halfDomain / texels; by contractDirection where contracted
  uint32_t texels = 0;
  Slice<const uint32_t> slotOfBlock;  // optional, [blocks]: kNoSlot where there is none
  // With `split`, room for mostSegments(rays). Optional, [blocks], or [slots]: those that are composited together have
  // the same number, and a segment is a run of one group; else each is its own.
  Slice<const uint32_t> groupOfBlock;
  Slice<uint32_t> firstSegment;          // [rays + 1]
  Slice<uint32_t> segmentCount;          // [1]
  Slice<uint32_t> firstSampleOfSegment;  // [segments + 1]: absolute rows
  Slice<uint32_t> groupOfSegment, rayOfSegment;

  uint32_t mostCuts() const { return space.columns + space.rows - 2 + (space.surround == Surround::own ? 1 : 0); }
  uint32_t mostSamples(uint32_t rayCount) const { return rayCount * (intervals + (split ? mostCuts() : 0)); }
  // One more with an own surround: rounding may put a short first interval before the box.
  uint32_t mostSegments(uint32_t rayCount) const {
    return rayCount * (mostCuts() + 1 + (space.surround == Surround::own ? 1 : 0));
  }
};
TESSERA_OPERATION(BlockSamples);

// Random points for the sparsity loss: point p draws from RandomStream(seed, 0x5ba) at index 8 p + purpose. It lies in
// block blocks[below(0)], evenly in its domain (purposes 1, 2, 3: x, y, z; a bounded block's z between bottom and top),
// with a runtime step along a direction that is even over the sphere, in scene units: z = 2 u4 - 1, angle 2π u5. For
// that step contracted coordinates stay 1 / kFarthest away from ±2, where it has no end.
struct BlockPoints {
  const BlockSpace& space;
  uint32_t points = 0;
  uint64_t seed = 0;
  uint32_t texels = 0;                // as in BlockSamples
  Slice<const uint32_t> blocks;       // to choose from
  Slice<const uint32_t> slotOfBlock;  // optional, [blocks]; as in BlockSamples
  Slice<uint32_t> blockOfSample;      // [points]
  Slice<float> positions;             // [points][3]
  Slice<float> runtimeSteps;          // [points]
};
TESSERA_OPERATION(BlockPoints);

// A stable sort of samples by block: source lists the rows of block 0 in order, then those of block 1, ...
struct GroupByBlock {
  Count samples;
  uint32_t blocks = 1;
  Slice<const uint32_t> blockOfSample;
  Slice<uint32_t> firstOfBlock;  // [blocks + 1], rows of `source`
  Slice<uint32_t> source;        // [capacity]
};
TESSERA_OPERATION(GroupByBlock);

}  // namespace tessera
