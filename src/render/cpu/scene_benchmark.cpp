#include "render/cpu/scene_benchmark.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <set>

#include "base/check.h"

namespace tessera {
namespace {

constexpr double kLow = 0.25;              // height above the box, scene units
constexpr double kHighInEdges = 2;         // rise in scene units (half blocks) per block of the scene's longer edge
constexpr double kAhead = 30, kDown = 75;  // camera pitches, degrees below the horizon
// Pixels: the image width to which CacheBenchmarkOptions::maximumScreenSpaceError refers.
constexpr double kFullWidth = 1280;

SceneRendererSettings settingsFor(const TileScene& scene, int threads) {
  SceneRendererSettings settings;
  settings.threads = threads;
  settings.background = Eigen::Array3f(scene.background[0], scene.background[1], scene.background[2]);
  return settings;
}

RenderedView drawTimed(SceneRenderer& renderer, const BenchmarkView& view, double& seconds) {
  using Clock = std::chrono::steady_clock;
  renderer.prepare(view.camera, view.worldFromCamera);
  const auto start = Clock::now();
  RenderedView drawn = renderer.render(view.camera, view.worldFromCamera, nullptr);
  seconds += std::chrono::duration<double>(Clock::now() - start).count();
  return drawn;
}

bool samePicture(const RenderedView& a, const RenderedView& b) {
  return a.colour.pixels == b.colour.pixels && a.opacity.pixels == b.opacity.pixels && a.depth.pixels == b.depth.pixels;
}

double meanSquare(const ImageF& a, const ImageF& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += (a.pixels[i] - b.pixels[i]) * (a.pixels[i] - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

// Counts what the cache holds from what was loaded, independently of the cache's own statistics.
class Watched {
 public:
  Watched(const TileScene& scene, const MakeDrawer& makeDrawer, const SceneRendererSettings& settings)
      : scene_(scene), bytes_(scene.tree.tiles.size()) {
    TileSource<Content> source = scene.source;
    source.load = [this](int tile) {
      std::unique_ptr<Content> content = scene_.source.load(tile);
      bytes_[tile] = content->memoryBytes();
      return content;
    };
    run_.budgetBytes = settings.budgetBytes;
    renderer_ = std::make_unique<SceneRenderer>(makeDrawer(), scene.frame, scene.tree, source, settings);
  }

  RenderedView draw(const Camera& camera, const Pose& pose) {
    RenderedView drawn = renderer_->render(camera, pose, nullptr);
    const TileCache<Content>& cache = renderer_->cache();
    uint64_t cachedBytes = 0;
    for (size_t tile = 0; tile < bytes_.size(); ++tile) {
      if (cache.holds(static_cast<int>(tile))) cachedBytes += bytes_[tile];
    }
    run_.stepsOverBudget += cachedBytes > run_.budgetBytes || cache.statistics().maxBytes > run_.budgetBytes;
    bool coarsest = scene_.tree.backgroundBlock < 0 || cache.holds(scene_.tree.backgroundBlock);
    for (const int tile : scene_.tree.coarsest()) coarsest &= cache.holds(tile);
    run_.stepsWithoutCoarsest += !coarsest;
    const std::vector<SelectedTile>& cut = renderer_->cut().tiles;
    const bool inMemory = std::all_of(cut.begin(), cut.end(),
                                      [&](const SelectedTile& s) { return !s.visible || cache.holds(s.content); });
    run_.stepsWithoutPartition += !inMemory || !isPartition(scene_.tree, cut);
    return drawn;
  }

  void compare(const RenderedView& drawn, const RenderedView& unbounded) {
    ++steps_;
    run_.refused += static_cast<uint64_t>(renderer_->choice().refused);
    for (const SelectedTile& one : renderer_->cut().tiles) {
      tilesOfLevel0_ += one.visible && scene_.tree.tiles[one.content].level == 0;
    }
    errors_ += meanSquare(drawn.colour, unbounded.colour);
    if (renderer_->choice().refused > 0) return;
    ++run_.stepsInFull;
    run_.stepsUnlikeUnbounded += !samePicture(drawn, unbounded);
  }

  CacheBenchmark::Run result() const {
    CacheBenchmark::Run run = run_;
    const TileCacheStatistics& statistics = renderer_->cacheStatistics();
    run.maxBytes = statistics.maxBytes;
    run.loads = statistics.loads;
    run.evictions = statistics.evictions;
    run.meanSquaredError = errors_ / steps_;
    run.tilesOfLevel0 = static_cast<double>(tilesOfLevel0_) / steps_;
    return run;
  }

 private:
  const TileScene& scene_;
  std::vector<uint64_t> bytes_;
  CacheBenchmark::Run run_;
  int steps_ = 0, tilesOfLevel0_ = 0;
  double errors_ = 0;
  std::unique_ptr<SceneRenderer> renderer_;
};

// Returns the memory that the tiles selected by `counts` take when drawn by `drawer`, counting each shared resource
// once.
template <class Counts>
uint64_t countMemoryBytes(const TileScene& scene, const CpuDrawer& drawer, const Counts& counts) {
  uint64_t bytes = 0;
  std::set<int> resources;
  for (size_t i = 0; i < scene.tree.tiles.size(); ++i) {
    if (!scene.tree.tiles[i].hasContent || !counts(scene.tree.tiles[i])) continue;
    const int tile = static_cast<int>(i);
    bytes += drawer.residentBytes(scene.source.bytes(tile));
    for (const int resource : scene.source.tileResources(tile)) resources.insert(resource);
  }
  for (const int resource : resources) {
    bytes += drawer.residentBytesOfResource(scene.source.bytesOfResource(resource));
  }
  return bytes;
}

Camera flightCamera(const CacheBenchmarkOptions& options) {
  Camera camera;
  camera.width = options.width;
  camera.height = options.height;
  const double focal = 0.8 * options.width;
  camera.parameters = {focal, focal, 0.5 * options.width, 0.5 * options.height};
  return camera;
}

}  // namespace

SkippingBenchmark benchmarkSkipping(const TileScene& scene, const MakeDrawer& makeDrawer,
                                    const std::vector<BenchmarkView>& views, int threads) {
  SceneRendererSettings settings = settingsFor(scene, threads);
  settings.selection.maximumScreenSpaceError = 0;
  SceneRenderer skipping(makeDrawer(), scene.frame, scene.tree, scene.source, settings);
  const std::vector<std::string_view> modes = makeDrawer()->skippingModes();
  std::optional<SceneRenderer> byCells;
  if (std::find(modes.begin(), modes.end(), "cells") != modes.end()) {
    settings.draw.skipping = "cells";
    byCells.emplace(makeDrawer(), scene.frame, scene.tree, scene.source, settings);
  }
  settings.draw.skipping = "none";
  SceneRenderer whole(makeDrawer(), scene.frame, scene.tree, scene.source, settings);
  SkippingBenchmark result;
  result.device = skipping.device();
  if (byCells) result.byCells.emplace();
  for (const BenchmarkView& view : views) {
    const ImageF picture = compositeOver(drawTimed(skipping, view, result.skipping.seconds), skipping.background());
    const auto compare = [&](SceneRenderer& other, double& seconds) {
      const ImageF drawn = compositeOver(drawTimed(other, view, seconds), other.background());
      for (size_t i = 0; i < picture.pixels.size(); ++i) {
        const double difference = std::abs(picture.pixels[i] - drawn.pixels[i]);
        result.largestDifference = std::max(result.largestDifference, difference);
      }
    };
    if (byCells) compare(*byCells, result.byCells->seconds);
    compare(whole, result.whole.seconds);
    result.rays += picture.pixelCount();
  }
  result.skipping.counts = skipping.drawCounts();
  if (byCells) result.byCells->counts = byCells->drawCounts();
  result.whole.counts = whole.drawCounts();
  return result;
}

CacheBenchmark benchmarkCache(const TileScene& scene, const MakeDrawer& makeDrawer,
                              const CacheBenchmarkOptions& options) {
  CacheBenchmark result;
  result.steps = options.steps;
  const std::unique_ptr<CpuDrawer> drawer = makeDrawer();
  result.allBytes = countMemoryBytes(scene, *drawer, [](const TileNode&) { return true; });
  result.finestBytes =
      countMemoryBytes(scene, *drawer, [](const TileNode& tile) { return !tile.isBackgroundBlock && tile.level == 0; });
  SceneRendererSettings settings = settingsFor(scene, options.threads);
  settings.selection.maximumScreenSpaceError = options.maximumScreenSpaceError * options.width / kFullWidth;
  settings.budgetBytes = static_cast<uint64_t>(options.finestShare * static_cast<double>(result.finestBytes));
  Watched tight(scene, makeDrawer, settings);
  settings.budgetBytes = result.allBytes;
  Watched whole(scene, makeDrawer, settings);
  settings.budgetBytes = std::numeric_limits<uint64_t>::max();
  SceneRenderer unbounded(makeDrawer(), scene.frame, scene.tree, scene.source, settings);
  const Camera camera = flightCamera(options);
  for (int step = 0; step < options.steps; ++step) {
    const Pose pose = flightPose(scene.frame, scene.tree, static_cast<double>(step) / options.steps);
    const RenderedView requested = unbounded.render(camera, pose, nullptr);
    CHECK(unbounded.choice().refused == 0);
    tight.compare(tight.draw(camera, pose), requested);
    whole.compare(whole.draw(camera, pose), requested);
  }
  result.tight = tight.result();
  result.whole = whole.result();
  return result;
}

Pose flightPose(const TileFrame& frame, const TileTree& tree, double lap) {
  const bool high = lap >= 0.5;
  const double half = 2 * lap - (high ? 1 : 0), row = half * tree.rows;
  const bool back = static_cast<int>(row) % 2 == 1;
  const double across = row - std::floor(row), x = tree.columns * (2 * (back ? 1 - across : across) - 1);
  const double rise = high ? half * kHighInEdges * std::max(tree.columns, tree.rows) : 0;
  const Vec3d eye(x, tree.rows * (2 * half - 1), frame.high.z() + kLow + rise);
  const double below = (high ? kDown : kAhead) * std::numbers::pi / 180;
  const Vec3d forward((back ? -1 : 1) * std::cos(below), 0, -std::sin(below));
  const Vec3d right = forward.cross(Vec3d::UnitZ()).normalized();
  Mat3d sceneFromCamera;
  sceneFromCamera.col(0) = right;
  sceneFromCamera.col(1) = forward.cross(right);
  sceneFromCamera.col(2) = forward;
  return {frame.rotation * sceneFromCamera, frame.translation + frame.scale * (frame.rotation * eye)};
}

bool isPartition(const TileTree& tree, const std::vector<SelectedTile>& cut) {
  std::vector<int> times(static_cast<size_t>(tree.columns) * tree.rows);
  for (const SelectedTile& selected : cut) {
    const TileCells& cells = tree.tiles[selected.tile].cells;
    for (int j = cells.j0; j < cells.j1; ++j) {
      for (int i = cells.i0; i < cells.i1; ++i) ++times[i + static_cast<size_t>(tree.columns) * j];
    }
  }
  return std::all_of(times.begin(), times.end(), [](int count) { return count == 1; });
}

}  // namespace tessera
