// What skipping empty space saves, and what a cache smaller than the scene costs, measured on a baked scene.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "render/cpu/scene_renderer.h"
#include "render/tile_scene.h"

namespace tessera {

struct BenchmarkView {
  Camera camera;
  Pose worldFromCamera;
};

struct DrawingCost {
  DrawCounts counts;
  double seconds = 0;  // of drawing; loading is left out
};

// The same views of the finest level, drawn with empty space skipped and without. All ways draw the same picture.
struct SkippingBenchmark {
  std::string device;
  uint64_t rays = 0;
  DrawingCost skipping, whole;
  std::optional<DrawingCost> byCells;  // where the drawer has that mode: by the levels of the occupancy alone
  double largestDifference = 0;        // of any value of a pixel's colour, which is in [0,1]
};

// Makes the drawer of the scene's representation.
using MakeDrawer = std::function<std::unique_ptr<CpuDrawer>()>;

// `threads`: as SceneRendererSettings. CHECKs that the drawer has the mode "none".
SkippingBenchmark benchmarkSkipping(const TileScene& scene, const MakeDrawer& makeDrawer,
                                    const std::vector<BenchmarkView>& views, int threads);

struct CacheBenchmarkOptions {
  int steps = 600;
  int width = 96, height = 64;  // of the pictures
  double finestShare = 0.25;    // the budget, as a share of what the finest level takes in memory
  double mostPixels = 1.5;      // of geometric error, were the pictures 1280 wide: as many tiles as people would need
  int threads = 0;              // as SceneRendererSettings
};

// A flight over every block, low and then ever higher, drawn three times at each step: with the budget, with one that
// is just all contents, and without.
struct CacheBenchmark {
  struct Run {
    uint64_t budgetBytes = 0;
    uint64_t mostBytes = 0;  // held at any moment
    uint64_t loads = 0, evictions = 0;
    uint64_t refused = 0;  // tiles that a view asked for without there being room, of all views
    int stepsOverBudget = 0, stepsWithoutCoarsest = 0;
    int stepsWithoutPartition = 0;  // the cut left a cell out, or held one twice, or a tile that is not in memory
    int stepsInFull = 0;            // all that the view asked for was there
    int stepsUnlikeUnbounded = 0;   // of them, where a bit of the picture was not the same as without a budget
    double meanSquaredError = 0;    // of all pictures' colours, from those without a budget
    double tilesOfLevel0 = 0;       // drawn in a picture, on average
  };
  uint64_t finestBytes = 0, allBytes = 0;
  int steps = 0;
  Run tight, whole;
};

// Throws Error where the coarsest level and the surround do not fit into the budget.
CacheBenchmark benchmarkCache(const TileScene& scene, const MakeDrawer& makeDrawer,
                              const CacheBenchmarkOptions& options);

// The flight, at `lap` in [0,1): along the rows of cells forth and back, so that each is flown over. In the first half
// of it a quarter of a half block above the box and looking ahead; in the second rising to twice the scene's edge and
// looking down.
Pose flightPose(const TileFrame& frame, const TileTree& tree, double lap);

// Does the cut stand for each cell exactly once?
bool isPartition(const TileTree& tree, const std::vector<SelectedTile>& cut);

}  // namespace tessera
