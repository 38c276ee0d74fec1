// Benchmarks of a baked scene: what empty-space skipping saves, and what a cache smaller than the scene costs.
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
  double seconds = 0;  // spent on drawing, without loading
};

// Costs of drawing the same views of the finest level with and without empty-space skipping. All modes produce the same
// image.
struct SkippingBenchmark {
  std::string device;
  uint64_t rays = 0;
  // `skipping` uses the fastest mode, `whole` evaluates every step.
  DrawingCost skipping, whole;
  std::optional<DrawingCost> byCells;  // with skipping by the occupancy levels alone, if the drawer has that mode
  double largestDifference = 0;        // largest absolute difference of a colour value, which is in [0,1]
};

// Makes a drawer for the scene's representation.
using MakeDrawer = std::function<std::unique_ptr<CpuDrawer>()>;

// `threads`: see SceneRendererSettings. CHECKs that the drawer has the mode "none".
SkippingBenchmark benchmarkSkipping(const TileScene& scene, const MakeDrawer& makeDrawer,
                                    const std::vector<BenchmarkView>& views, int threads);

struct CacheBenchmarkOptions {
  int steps = 600;
  int width = 96, height = 64;  // pixels of a rendered image
  double finestShare = 0.25;    // the budget, as a fraction of the memory that the finest level needs
  // Geometric error in pixels of an image 1280 pixels wide: selects as many tiles as a viewer of that width would.
  double maximumScreenSpaceError = 1.5;
  int threads = 0;  // see SceneRendererSettings
};

// A flight over every block, first low and then ever higher. Every step is drawn three times: with the tight budget,
// with a budget that is just large enough for all contents, and without a budget.
struct CacheBenchmark {
  struct Run {
    uint64_t budgetBytes = 0;
    uint64_t maxBytes = 0;  // largest number of bytes resident at any moment
    uint64_t loads = 0, evictions = 0;
    uint64_t refused = 0;  // tiles that the views requested but that did not fit into the budget, summed over all views
    int stepsOverBudget = 0, stepsWithoutCoarsest = 0;
    int stepsWithoutPartition =
        0;                // steps whose cut missed a cell, covered one twice, or held a tile that is not in memory
    int stepsInFull = 0;  // steps at which everything that the view requested was in memory
    int stepsUnlikeUnbounded = 0;  // those of stepsInFull whose image differed in any bit from the one without a budget
    double meanSquaredError = 0;   // of the colours of all images, against those without a budget
    double tilesOfLevel0 = 0;      // mean number of level-0 tiles drawn per image
  };
  uint64_t finestBytes = 0, allBytes = 0;
  int steps = 0;
  Run tight, whole;
};

// Throws Error if the coarsest level and the background block do not fit into the budget.
CacheBenchmark benchmarkCache(const TileScene& scene, const MakeDrawer& makeDrawer,
                              const CacheBenchmarkOptions& options);

// The camera pose of the flight at `lap` in [0,1). The flight follows the rows of cells back and forth, so that it
// passes over every cell. In the first half the camera is a quarter of a half block above the scene's box and looks
// ahead; in the second half it rises by up to the length of the scene's longer edge and looks down.
Pose flightPose(const TileFrame& frame, const TileTree& tree, double lap);

// Returns whether the cut covers each cell exactly once.
bool isPartition(const TileTree& tree, const std::vector<SelectedTile>& cut);

}  // namespace tessera
