// `tessera bench render`: a scene on the CPU with and without skipping empty space, beside a model, and through a small
// cache.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "apps/tessera/render_source.h"
#include "apps/tessera/verb_bench.h"
#include "base/error.h"
#include "eval/psnr.h"
#include "eval/render_views.h"
#include "import/capture_reader.h"
#include "render/cpu/scene_benchmark.h"
#include "render/tile_scene.h"
#include "representations/codecs.h"
#include "representations/cpu_drawers.h"
#include "representations/methods.h"
#include "tiles/scene_folder.h"
#include "train/model_folder.h"

namespace tessera {
namespace {

using nlohmann::ordered_json;

void printSkipping(const SkippingBenchmark& b) {
  const auto line = [&](const char* name, const DrawingCost& way) {
    fmt::print("  {:<10} {:12d} steps  {:12d} samples  {:8.3f} M rays/s\n", name, way.counts.steps, way.counts.samples,
               static_cast<double>(b.rays) / way.seconds / 1e6);
  };
  fmt::print("{}\nempty space, {} rays\n", b.device, b.rays);
  line("skipped", b.skipping);
  if (b.byCells) line("by cells", *b.byCells);
  line("walked", b.whole);
  fmt::print(
      "  {:.1f} times fewer steps, images that differ by at most {:.6f}\n",
      static_cast<double>(b.whole.counts.steps) / static_cast<double>(std::max<uint64_t>(1, b.skipping.counts.steps)),
      b.largestDifference);
}

ordered_json toJson(const SkippingBenchmark& b) {
  const auto way = [&](const DrawingCost& w) -> ordered_json {
    return {{"steps", w.counts.steps},
            {"samples", w.counts.samples},
            {"seconds", w.seconds},
            {"rays_per_second", static_cast<double>(b.rays) / w.seconds}};
  };
  return {{"device", b.device},          {"rays", b.rays},
          {"skipping", way(b.skipping)}, {"by_cells", b.byCells ? way(*b.byCells) : ordered_json()},
          {"whole", way(b.whole)},       {"largest_difference", b.largestDifference}};
}

void printCache(const CacheBenchmark& b) {
  constexpr double kMiB = 1 << 20;
  const auto line = [&](const char* name, const CacheBenchmark::Run& run) {
    fmt::print(
        "  {:<8} {:9.2f} MiB allowed, {:9.2f} MiB resident at most; {} loads, {} evictions, {} blocks refused\n"
        "           steps over budget {}, without the coarsest level {}, with an invalid cut {};\n"
        "           with all that the view requests {}, of these differing from an unbounded cache's image {};\n"
        "           blocks of the finest level {:.2f} a step; {:.2f} dB from an unbounded cache's images\n",
        name, static_cast<double>(run.budgetBytes) / kMiB, static_cast<double>(run.maxBytes) / kMiB, run.loads,
        run.evictions, run.refused, run.stepsOverBudget, run.stepsWithoutCoarsest, run.stepsWithoutPartition,
        run.stepsInFull, run.stepsUnlikeUnbounded, run.tilesOfLevel0, psnrFromMeanSquaredError(run.meanSquaredError));
  };
  fmt::print("cache, {} steps; the finest level takes {:.2f} MiB, all {:.2f} MiB\n", b.steps,
             static_cast<double>(b.finestBytes) / kMiB, static_cast<double>(b.allBytes) / kMiB);
  line("share", b.tight);
  line("all", b.whole);
}

ordered_json toJson(const CacheBenchmark& b) {
  const auto run = [](const CacheBenchmark::Run& r) -> ordered_json {
    return {{"budget_bytes", r.budgetBytes},
            {"max_bytes", r.maxBytes},
            {"loads", r.loads},
            {"evictions", r.evictions},
            {"refused", r.refused},
            {"steps_over_budget", r.stepsOverBudget},
            {"steps_without_coarsest", r.stepsWithoutCoarsest},
            {"steps_without_partition", r.stepsWithoutPartition},
            {"steps_in_full", r.stepsInFull},
            {"steps_unlike_unbounded", r.stepsUnlikeUnbounded},
            {"finest_blocks_a_step", r.tilesOfLevel0},
            {"mean_squared_error", r.meanSquaredError}};
  };
  return {{"steps", b.steps},
          {"finest_bytes", b.finestBytes},
          {"all_bytes", b.allBytes},
          {"share", run(b.tight)},
          {"all", run(b.whole)}};
}

bool countsSamples(const Method& method) {
  return method.countsSamples;
}

// Returns the method of the model that a scene is compared with. Throws Error if the method does not count samples.
const Method& methodBeside(const fs::path& folder) {
  const Method& method = findModelMethod(ModelFolder(folder));
  if (method.countsSamples) return method;
  throw Error(folder.string(), "manifest.json",
              fmt::format("is of --method {}, but {} is required", method.name, namesOfMethods(countsSamples, "or")),
              "name another model");
}

// One of the renderers that are compared, and what it has done so far.
struct Contestant {
  std::string key, label;  // in the JSON and in the printed lines
  ViewRenderer& renderer;
  std::vector<double> secondsOfRound;
  double seconds() const { return std::accumulate(secondsOfRound.begin(), secondsOfRound.end(), 0.0); }
};

double meanSquaredDifference(const RenderedView& one, const RenderedView& other) {
  double sum = 0;
  for (size_t i = 0; i < one.colour.pixels.size(); ++i) {
    const double difference = one.colour.pixels[i] - other.colour.pixels[i];
    sum += difference * difference;
  }
  return sum / static_cast<double>(one.colour.pixels.size());
}

// Compares a scene with a model whose samples are counted: as the model was trained, and limited to the cells that its
// training photos see, to which a scene is limited when it is baked. The views are rendered alternately, with the same
// transmittance threshold.
ordered_json measureAgainst(const TileScene& scene, const MakeDrawer& makeDrawer, const fs::path& folder,
                            const Capture& capture, const std::vector<BenchmarkView>& views, int threads, bool print) {
  const Method& method = methodBeside(folder);
  requireSameWorld(ModelFolder(folder), capture);
  const std::unique_ptr<Device> device = makeDevice({"cpu", threads});
  const std::unique_ptr<OpenedModel> model = method.openModel(*device, folder);
  const std::unique_ptr<OpenedModel> culled = method.openModel(*device, folder);
  culled->cullUnseen(capture, {});
  const OpenedModel::RayWork culling = culled->rayWork();
  SceneRendererSettings settings;
  settings.threads = threads;
  settings.selection.maximumScreenSpaceError = 0;
  settings.draw.minTransmittance = model->rayWork().minTransmittance;
  SceneRenderer renderer(makeDrawer(), scene.frame, scene.tree, scene.source, settings);
  constexpr int kRounds = 3;
  const std::string name(method.name);
  std::vector<Contestant> contestants = {{"scene", "scene", renderer, {}},
                                         {name, name, model->renderer(), {}},
                                         {name + "_culled", name + ", culled", culled->renderer(), {}}};
  uint64_t rays = 0;
  double culledError = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (Contestant& each : contestants) each.secondsOfRound.push_back(0);
    for (const BenchmarkView& view : views) {
      renderer.prepare(view.camera, view.worldFromCamera);
      std::vector<RenderedView> images;
      for (Contestant& each : contestants) {
        const auto start = std::chrono::steady_clock::now();
        images.push_back(each.renderer.render(view.camera, view.worldFromCamera, nullptr));
        each.secondsOfRound.back() += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      }
      culledError += meanSquaredDifference(images[1], images[2]);
      rays += static_cast<uint64_t>(view.camera.width) * static_cast<uint64_t>(view.camera.height);
    }
  }
  const OpenedModel::RayWork work = model->rayWork(), culledWork = culled->rayWork();
  const auto perRay = [&](uint64_t number) { return static_cast<double>(number) / static_cast<double>(rays); };
  const std::vector<double> samples = {perRay(renderer.drawCounts().samples), perRay(work.samples),
                                       perRay(culledWork.samples - culling.samples)};
  const std::vector<double> densities = {samples[0], perRay(work.densities),
                                         perRay(culledWork.densities - culling.densities)};
  const double frames = kRounds * static_cast<double>(views.size());
  ordered_json json = {{"device", renderer.device()},
                       {"culled_psnr_against_unculled", psnrFromMeanSquaredError(culledError / frames)}};
  if (print) fmt::print("{}\n", renderer.device());
  for (size_t i = 0; i < contestants.size(); ++i) {
    const Contestant& each = contestants[i];
    std::vector<double> ratios;
    for (int round = 0; round < kRounds; ++round) {
      ratios.push_back(each.secondsOfRound[round] / contestants[0].secondsOfRound[round]);
    }
    const double times = each.seconds() / contestants[0].seconds();
    const double minimum = *std::min_element(ratios.begin(), ratios.end());
    json[each.key] = {{"frames_per_second", frames / each.seconds()},
                      {"densities_per_ray", densities[i]},
                      {"samples_per_ray", samples[i]},
                      {"times", times},
                      {"min_times", minimum}};
    if (!print) continue;
    fmt::print("  {:<15} {:7.2f} frames/s, {:5.1f} densities and {:5.1f} samples a ray", each.label,
               frames / each.seconds(), densities[i], samples[i]);
    if (i > 0) {
      fmt::print("; the scene is {:.2f} times as fast, at least {:.2f} in each of {} rounds", times, minimum, kRounds);
    }
    fmt::print("\n");
  }
  return json;
}

struct SceneMeasurement {
  fs::path scene;
  std::vector<BenchmarkView> views;
  std::optional<CacheBenchmarkOptions> flight;
  fs::path against;
  const Capture* capture = nullptr;  // that the views are of
  int threads = 0;
  bool print = true;
};

ordered_json measureScene(const SceneMeasurement& what) {
  const Tileset tileset = readTileset(what.scene);
  const TileScene scene = openTileScene(what.scene, requireCodec(what.scene, tileset));
  const MakeDrawer makeDrawer = [&] { return makeCpuDrawer(tileset.representation); };
  ordered_json json = ordered_json::object();
  if (!what.against.empty()) {
    json["against"] =
        measureAgainst(scene, makeDrawer, what.against, *what.capture, what.views, what.threads, what.print);
  } else if (!what.views.empty()) {
    const SkippingBenchmark skipping = benchmarkSkipping(scene, makeDrawer, what.views, what.threads);
    if (what.print) printSkipping(skipping);
    json["skipping"] = toJson(skipping);
  }
  if (what.flight) {
    const CacheBenchmark cache = benchmarkCache(scene, makeDrawer, *what.flight);
    if (what.print) printCache(cache);
    json["cache"] = toJson(cache);
  }
  return json;
}

}  // namespace

void addBenchRender(CLI::App& bench) {
  struct Flags {
    std::string scene, views, against, json;
    bool flight = false;
    CacheBenchmarkOptions cache;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = bench.add_subcommand("render", "what skipping empty space saves, and a flight with a small cache");
  verb->footer(
      "Examples:\n  tessera bench render city.scene --views city.capture\n"
      "  tessera bench render city.scene --flight --share 0.25");
  verb->add_option("scene", flags->scene, "scene folder")->required();
  CLI::Option* ofViews =
      verb->add_option("--views", flags->views, "render this capture's held-out views with and without skipping");
  verb->add_option("--against", flags->against,
                   fmt::format("instead, render these views alternately with this model of --method {}, and compare",
                               namesOfMethods(countsSamples, "or")))
      ->needs(ofViews);
  CLI::Option* flight =
      verb->add_flag("--flight", flags->flight, "fly over all blocks, low and high, with a small cache");
  verb->add_option("--steps", flags->cache.steps, "images of the flight")
      ->capture_default_str()
      ->check(CLI::Range(2, 1 << 20))
      ->needs(flight);
  verb->add_option("--share", flags->cache.finestShare,
                   "the cache, as a share of what the finest level takes in memory")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e3))
      ->needs(flight);
  verb->add_option("--json", flags->json, "write the result as one JSON object here; - prints it");
  verb->add_option("--threads", flags->cache.threads, "CPU threads; 0: all cores")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
  verb->callback([flags] {
    if (flags->views.empty() && !flags->flight) throw CLI::RequiredError("--views or --flight");
    std::vector<BenchmarkView> views;
    Capture capture;
    if (!flags->views.empty()) {
      capture = readCapture(flags->views);
      openRenderSource(*makeDevice({}), flags->scene, {})->requireMatchingWorld(capture);
      for (const NamedView& view : viewsOfCapture(capture, Split::test)) {
        views.push_back({view.camera, view.worldFromCamera});
      }
    }
    const std::optional<CacheBenchmarkOptions> cache = flags->flight ? std::optional(flags->cache) : std::nullopt;
    const SceneMeasurement what{flags->scene,      views, cache, flags->against, &capture, flags->cache.threads,
                                flags->json != "-"};
    writeJson(flags->json, measureScene(what));
  });
}

}  // namespace tessera
