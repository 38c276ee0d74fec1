// A scene cut into square blocks on the ground (City-on-Web, section 4.1), and samples along rays through it.
#pragma once

#include <array>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// How the space outside the region of interest is represented.
//   none     it is empty
//   border   the blocks at the border are contracted and own the half-strips and quadrants outside (the paper)
//   own      one additional, contracted block owns it, so that the other blocks use their whole resolution for the
//            region. It is visible only behind the region: rays begin where they enter the box
enum class BackgroundBlockMode { none, border, own };

// The grid of blocks, in scene units: half the edge of a block is 1, and the origin is the centre of the grid. The box
// is [-columns, columns] × [-rows, rows] × [bottom, top]. Cell (i, j) has index i + columns · j and covers x in
// [2i - columns, 2i + 2 - columns] and y in [2j - rows, 2j + 2 - rows]. Blocks are convex and do not overlap.
struct BlockSpace {
  uint32_t columns = 1, rows = 1;
  float bottom = -1, top = 1;  // in [-1,1]
  float near = 0.05f;          // minimum distance of samples from the camera
  BackgroundBlockMode backgroundBlock = BackgroundBlockMode::own;

  uint32_t cells() const { return columns * rows; }
  uint32_t blocks() const {
    return cells() + (backgroundBlock == BackgroundBlockMode::own ? 1 : 0);
  }  // the background block is the last

  // Local coordinates are q = (x - centre) / scale per axis. A cell has scale 1 and the centre (2i + 1 - columns,
  // 2j + 1 - rows, 0); the background block has scale (columns, rows, 1) and is centred on the origin. The domain of a
  // bounded block is [-1,1]³, with coordinates q; that of a contracted block is [-2,2]³, with q contracted by
  // scene/contraction.h.
  struct Placement {
    float centre[3] = {0, 0, 0}, scale[3] = {1, 1, 1};
    bool contracted = false;
    float halfDomain() const { return contracted ? 2.0f : 1.0f; }
  };
  Placement placement(uint32_t block) const;

  // The box that a block owns; unbounded sides end at kFarthest. For the background block this is all of space, because
  // it is visible only behind the box.
  struct Box {
    std::array<float, 3> low, high;
  };
  Box owned(uint32_t block) const;

  // The interval of distances at which a ray lies in the box, beginning no nearer than `near`.
  struct Range {
    double near = 0, far = 0;
    bool empty() const { return !(near < far); }
  };
  Range rangeInBox(const std::array<double, 3>& origin, const std::array<double, 3>& direction, double near) const;

  // The block that owns a point: the cell of x and y, clamped to the grid; with BackgroundBlockMode::own, the
  // background block for every point outside the box.
  uint32_t blockAt(double x, double y, double z) const;

  // Maps s in [0,1] to the distance t along a ray that lies in the box for [near, far]. Unless backgroundBlock is none,
  // s in [0, 3/4] is linear in t over the box, and s in (3/4, 1] is linear in 1/t from there to kFarthest; otherwise s
  // is linear in t over the box.
  static constexpr double kBoxShare = 0.75, kFarthest = 1e6;
  double distanceAt(double s, double near, double far) const;
  double shareAt(double t, double near, double far) const;  // the inverse of distanceAt: returns s
};

// Marks a block that is not resident in a table that maps blocks to slots. When a scene is trained a few blocks at a
// time, the resident blocks occupy slots, and samples refer to slots instead of blocks.
inline constexpr uint32_t kNoSlot = UINT32_MAX;

// Computes where rays enter and leave the box, and their initial interval boundaries (fences). The range is
// [max(near, entry), exit]. If that is empty, it is [near, near + 1 + |ray origin|] with a background block or border,
// and [near, near] without. The fences are 0, (i + jitter - ½) / intervals for 0 < i < intervals, and 1. `near` is the
// larger of `space.near` and the ray's own `nearOfRay`.
struct EnterScene {
  const BlockSpace& space;
  Count rays;
  uint32_t intervals = 64;
  Slice<const float> origins;     // [rays][3]
  Slice<const float> directions;  // [rays][3], unit; zero means no ray, with the range [near, near]
  Slice<const float> jitter;      // optional, [rays], in [0,1); ½ if absent
  Slice<const float> nearOfRay;   // optional, [rays]
  Slice<float> range;             // [rays][2]
  Slice<float> fences;            // [rays][intervals + 1]
};
TESSERA_OPERATION(EnterScene);

// Turns the intervals between fences into samples at their middles (in t). Rows are written from `firstRow` on, ray by
// ray, front to back. With `split`, intervals are cut where the ray passes from one block to another: at every distance
// where its x or y lies on an inner cell wall and, with BackgroundBlockMode::own, where it leaves the box (range[1]),
// if that lies strictly inside an interval (in s). No sample then straddles two blocks, and the consecutive samples of
// a ray in one block form a segment. A sample belongs to the block of its middle. Positions are in [0,1]³ over the
// block's domain; a sample outside the domain of a bounded block (above or below an inner cell of a grid whose border
// is contracted) keeps its row with step 0 and a clamped position. Intervals are cut off at `farOfRay`: steps shrink,
// to 0 beyond it, but middles are not moved. Computed in double. A ray with direction zero is not cut, and its steps
// and runtime steps are 0. With `slotOfBlock`, all outputs refer to blocks by their slots; a sample in a block without
// a slot keeps its row with slot 0 and step 0.
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
  Slice<uint32_t> firstSample;             // [rays + 1]: absolute rows
  Slice<uint32_t> rowCount;                // [1]: firstRow + the number of samples
  // Per sample, with a capacity of firstRow + maxSamples(rays) rows:
  Slice<uint32_t> blockOfSample;
  Slice<float> positions;     // [rows][3]
  Slice<float> distances;     // t of the middle
  Slice<float> steps;         // length in t
  Slice<float> middles;       // optional: the mean of both ends in s
  Slice<float> widths;        // optional: length in s
  Slice<float> runtimeSteps;  // optional: length in t of a renderer's step along the ray at the sample: one texel of
                              // the domain, 2 halfDomain / texels, mapped by contractDirection in a contracted block
  uint32_t texels = 0;
  Slice<const uint32_t> slotOfBlock;  // optional, [blocks]: kNoSlot for a block that is not resident
  // Optional, [blocks], or [slots] with slotOfBlock: blocks that are composited together have the same group, and a
  // segment is a run of samples of one group; if absent, each block is a group of its own.
  Slice<const uint32_t> groupOfBlock;
  // Written with `split` only, with a capacity of maxSegments(rays) segments:
  Slice<uint32_t> firstSegment;          // [rays + 1]
  Slice<uint32_t> segmentCount;          // [1]
  Slice<uint32_t> firstSampleOfSegment;  // [segments + 1]: absolute rows
  Slice<uint32_t> groupOfSegment, rayOfSegment;

  uint32_t maxCuts() const {
    return space.columns + space.rows - 2 + (space.backgroundBlock == BackgroundBlockMode::own ? 1 : 0);
  }
  uint32_t maxSamples(uint32_t rayCount) const { return rayCount * (intervals + (split ? maxCuts() : 0)); }
  // BackgroundBlockMode::own may add one segment: rounding can leave a short first interval in front of the box.
  uint32_t maxSegments(uint32_t rayCount) const {
    return rayCount * (maxCuts() + 1 + (space.backgroundBlock == BackgroundBlockMode::own ? 1 : 0));
  }
};
TESSERA_OPERATION(BlockSamples);

// Generates random points for the sparsity loss. Point p draws from RandomStream(seed, 0x5ba) at index 8 p + purpose.
// It lies in block blocks[below(0)], uniformly distributed over its domain (purposes 1, 2 and 3 give x, y and z; in a
// bounded block z lies between bottom and top). Its runtime step, in scene units, is taken along a direction that is
// uniformly distributed over the sphere: z = 2 u4 - 1, angle 2π u5. To compute that step, contracted coordinates are
// clamped to a distance of 1 / kFarthest from ±2, where the step would be infinite.
struct BlockPoints {
  const BlockSpace& space;
  uint32_t points = 0;
  uint64_t seed = 0;
  uint32_t texels = 0;                // see BlockSamples
  Slice<const uint32_t> blocks;       // the blocks to choose from
  Slice<const uint32_t> slotOfBlock;  // optional, [blocks]; see BlockSamples
  Slice<uint32_t> blockOfSample;      // [points]
  Slice<float> positions;             // [points][3]
  Slice<float> runtimeSteps;          // [points]
};
TESSERA_OPERATION(BlockPoints);

// Sorts samples by block, stably: `source` lists the rows of block 0 in order, then those of block 1, and so on.
struct GroupByBlock {
  Count samples;
  uint32_t blocks = 1;
  Slice<const uint32_t> blockOfSample;
  Slice<uint32_t> firstOfBlock;  // [blocks + 1], rows of `source`
  Slice<uint32_t> source;        // [capacity]
};
TESSERA_OPERATION(GroupByBlock);

}  // namespace tessera
