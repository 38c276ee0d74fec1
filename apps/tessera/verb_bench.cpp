#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "apps/tessera/render_source.h"
#include "apps/tessera/scene_source.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "compute/roofline.h"
#include "eval/psnr.h"
#include "eval/render_views.h"
#include "import/capture_reader.h"
#include "render/cpu/scene_benchmark.h"
#include "render/tile_scene.h"
#include "representations/codecs.h"
#include "representations/cpu_drawers.h"
#include "representations/methods.h"
#include "tiles/scene_folder.h"
#include "train/run_folder.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "gpu/context.h"
#include "representations/gpu_drawers.h"
#endif

namespace tessera {
namespace {

using nlohmann::ordered_json;

std::string scaled(double value, const std::string& unit) {
  if (value >= 1e9) return fmt::format("{:8.2f} G{}/s", value / 1e9, unit);
  return fmt::format("{:8.2f} M{}/s", value / 1e6, unit);
}

std::string formatShare(const RooflineRow& row) {
  return row.limit > 0 ? fmt::format("{:5.0f} %", 100 * row.share()) : std::string("      -");
}

void printRoofline(const Roofline& roofline) {
  fmt::print("{}\n\nlimits, measured now\n", roofline.device);
  if (roofline.limits.flops > 0) {
    fmt::print("  {:<44} {}\n", "multiply-adds on registers", scaled(roofline.limits.flops, "FLOP"));
    for (const MachineLimits::Stream& stream : roofline.limits.streams) {
      fmt::print("  {:<44} {}\n", fmt::format("copy within {:.0f} KiB, read + written", stream.bytes / 1024.0),
                 scaled(stream.rate, "B"));
    }
    for (const MachineLimits::Gather& gather : roofline.limits.gathers) {
      fmt::print("  {:<44} {}\n", fmt::format("random 8-byte loads from {:.0f} KiB", gather.tableBytes / 1024.0),
                 scaled(gather.lookups, "lookup"));
    }
  } else {
    fmt::print("  none: the reference device is not built for speed\n");
  }
  if (roofline.limits.matrixFlops > 0) {
    fmt::print("  {:<44} {}\n", "products of fp16 matrices", scaled(roofline.limits.matrixFlops, "FLOP"));
  }
  fmt::print("\n{:<28} {:<44} {:>9}  {:>17}  {:>17}  {:>7}\n", "operation", "shape", "ms", "rate", "limit", "share");
  for (const RooflineRow& row : roofline.rows) {
    fmt::print("{:<28} {:<44} {:>9.3f}  {:>17}  {:>17}  {}\n", row.name, row.shape, 1e3 * row.seconds,
               scaled(row.rate, row.unit), row.limit > 0 ? scaled(row.limit, row.unit) : "-", formatShare(row));
  }
  fmt::print(
      "\nBest of several runs each. Networks count 2 x weights x samples forward and twice that backward; the hash\n"
      "grid 8 x levels x samples lookups against random gathers from tables of the same sizes; the virtual grid 20 x\n"
      "samples lookups against gathers or a copy of its arguments, whichever is slower; all others the bytes of their\n"
      "arguments, each once, against a copy of the same size. Points on rays revisit what the cache still holds and\n"
      "may pass the limit.\n");
}

ordered_json toJson(const Roofline& roofline) {
  ordered_json streams = ordered_json::array(), gathers = ordered_json::array(), rows = ordered_json::array();
  for (const MachineLimits::Stream& stream : roofline.limits.streams) {
    streams.push_back({{"footprint_bytes", stream.bytes}, {"bytes_per_second", stream.rate}});
  }
  for (const MachineLimits::Gather& gather : roofline.limits.gathers) {
    gathers.push_back({{"table_bytes", gather.tableBytes}, {"lookups_per_second", gather.lookups}});
  }
  for (const RooflineRow& row : roofline.rows) {
    rows.push_back({{"operation", row.name},
                    {"shape", row.shape},
                    {"seconds", row.seconds},
                    {"rate", row.rate},
                    {"unit", row.unit + "/s"},
                    {"limit", row.limit > 0 ? ordered_json(row.limit) : ordered_json()},
                    {"share", row.limit > 0 ? ordered_json(row.share()) : ordered_json()},
                    {"memory_limit", row.memoryLimit > 0 ? ordered_json(row.memoryLimit) : ordered_json()},
                    {"share_of_both", row.limit > 0 ? ordered_json(row.shareOfBoth()) : ordered_json()}});
  }
  return {{"device", roofline.device},
          {"flops_per_second", roofline.limits.flops},
          {"matrix_flops_per_second", roofline.limits.matrixFlops},
          {"streams", streams},
          {"gathers", gathers},
          {"operations", rows}};
}

void printStep(const std::string& device, const StepBenchmark& step) {
  fmt::print("{}\n{} samples a step, {} steps: median {:.1f} ms, best {:.1f} ms\n", device, step.samples, step.steps,
             1e3 * step.medianSeconds, 1e3 * step.bestSeconds);
  for (const StepBenchmark::Phase& phase : step.phases) {
    fmt::print("  {:<10} {:6.1f} ms  {:3.0f} %\n", phase.name, 1e3 * phase.medianSeconds,
               100 * phase.medianSeconds / step.medianSeconds);
  }
  fmt::print("whole training step: {:.3f} M samples/s (loss {:.4f} -> {:.4f})\n", step.samplesPerSecond / 1e6,
             step.firstLoss, step.lastLoss);
}

ordered_json toJson(const std::string& device, const StepBenchmark& step) {
  ordered_json phases = ordered_json::object();
  for (const StepBenchmark::Phase& phase : step.phases) phases[phase.name] = phase.medianSeconds;
  return {{"device", device},
          {"samples", step.samples},
          {"steps", step.steps},
          {"seconds_median", step.medianSeconds},
          {"seconds_best", step.bestSeconds},
          {"samples_per_second", step.samplesPerSecond},
          {"phase_seconds", phases},
          {"first_loss", step.firstLoss},
          {"last_loss", step.lastLoss}};
}

// Writes JSON to a file; `-` means standard output, on which nothing else is printed.
void writeJson(const std::string& file, const ordered_json& json) {
  if (file == "-") {
    fmt::print("{}\n", json.dump(2));
  } else if (!file.empty()) {
    writeFileAtomically(file, json.dump(2) + "\n");
  }
}

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
      "  {:.1f} times fewer steps, pictures apart by at most {:.6f}\n",
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
        "           blocks of the finest level {:.2f} a step; {:.2f} dB from an unbounded cache's pictures\n",
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

struct DrawnViews {
  double seconds = 0;
  uint64_t rays = 0, samples = 0;
  double samplesPerRay() const { return static_cast<double>(samples) / static_cast<double>(rays); }
};

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

// Compares a scene with a model whose samples are counted. The views are rendered alternately, with the same
// transmittance threshold.
ordered_json measureAgainst(const TileScene& scene, const MakeDrawer& makeDrawer, const fs::path& folder,
                            const std::vector<BenchmarkView>& views, int threads, bool print) {
  const Method& method = methodBeside(folder);
  const std::unique_ptr<Device> device = makeDevice({"cpu", threads});
  const std::unique_ptr<OpenedModel> model = method.openModel(*device, folder);
  SceneRendererSettings settings;
  settings.threads = threads;
  settings.selection.maximumScreenSpaceError = 0;
  settings.draw.minTransmittance = model->rayWork().minTransmittance;
  SceneRenderer renderer(makeDrawer(), scene.frame, scene.tree, scene.source, settings);
  constexpr int kRounds = 3;
  DrawnViews ours, theirs;
  std::vector<double> ratios;
  const auto draw = [](ViewRenderer& how, const BenchmarkView& view) {
    const auto start = std::chrono::steady_clock::now();
    how.render(view.camera, view.worldFromCamera, nullptr);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  for (int round = 0; round < kRounds; ++round) {
    double seconds[2] = {0, 0};
    for (const BenchmarkView& view : views) {
      renderer.prepare(view.camera, view.worldFromCamera);
      seconds[0] += draw(renderer, view);
      seconds[1] += draw(model->renderer(), view);
      ours.rays += static_cast<uint64_t>(view.camera.width) * static_cast<uint64_t>(view.camera.height);
    }
    ours.seconds += seconds[0];
    theirs.seconds += seconds[1];
    ratios.push_back(seconds[1] / seconds[0]);
  }
  theirs.rays = ours.rays;
  ours.samples = renderer.drawCounts().samples;
  theirs.samples = model->rayWork().samples;
  const double frames = kRounds * static_cast<double>(views.size());
  const double minimum = *std::min_element(ratios.begin(), ratios.end()), all = theirs.seconds / ours.seconds;
  if (print) {
    fmt::print("{}\n  scene {:7.2f} frames/s, {:5.1f} samples a ray\n  {:<5} {:7.2f} frames/s, {:5.1f} samples a ray\n",
               renderer.device(), frames / ours.seconds, ours.samplesPerRay(), method.name, frames / theirs.seconds,
               theirs.samplesPerRay());
    fmt::print("  {:.2f} times as many frames, at least {:.2f} in each of {} rounds\n", all, minimum, kRounds);
  }
  return {{"device", renderer.device()},
          {"frames_per_second", frames / ours.seconds},
          {"samples_per_ray", ours.samplesPerRay()},
          {fmt::format("{}_frames_per_second", method.name), frames / theirs.seconds},
          {fmt::format("{}_samples_per_ray", method.name), theirs.samplesPerRay()},
          {"times", all},
          {"min_times", minimum}};
}

struct SceneMeasurement {
  fs::path scene;
  std::vector<BenchmarkView> views;
  std::optional<CacheBenchmarkOptions> flight;
  fs::path against;
  int threads = 0;
  bool print = true;
};

ordered_json measureScene(const SceneMeasurement& what) {
  const Tileset tileset = readTileset(what.scene);
  const TileScene scene = openTileScene(what.scene, requireCodec(what.scene, tileset));
  const MakeDrawer makeDrawer = [&] { return makeCpuDrawer(tileset.representation); };
  ordered_json json = ordered_json::object();
  if (!what.against.empty()) {
    json["against"] = measureAgainst(scene, makeDrawer, what.against, what.views, what.threads, what.print);
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
      verb->add_option("--views", flags->views, "draw this capture's held-out views with and without skipping");
  verb->add_option("--against", flags->against,
                   fmt::format("or beside this model, of --method {}, in turn", namesOfMethods(countsSamples, "or")))
      ->needs(ofViews);
  CLI::Option* flight =
      verb->add_flag("--flight", flags->flight, "fly over all blocks, low and high, with a small cache");
  verb->add_option("--steps", flags->cache.steps, "pictures of the flight")
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
    if (!flags->views.empty()) {
      const Capture capture = readCapture(flags->views);
      openRenderSource(*makeDevice({}), flags->scene, {})->requireMatchingWorld(capture);
      for (const NamedView& view : viewsOfCapture(capture, Split::test)) {
        views.push_back({view.camera, view.worldFromCamera});
      }
    }
    const std::optional<CacheBenchmarkOptions> cache = flags->flight ? std::optional(flags->cache) : std::nullopt;
    const SceneMeasurement what{flags->scene, views, cache, flags->against, flags->cache.threads, flags->json != "-"};
    writeJson(flags->json, measureScene(what));
  });
}

// Measures frames per second of a scene at one image size. Images rendered on a GPU are not downloaded, because
// displaying them does not require it.
ordered_json measureFrames(const Device& device, const fs::path& scene, const std::vector<BenchmarkView>& views,
                           const RenderSourceOptions& options, double seconds) {
  std::function<void(const BenchmarkView&)> draw;
  std::function<void()> wait = [] {};
  std::function<size_t()> refused = [] {
    return size_t{0};
  };  // contents of the last image that did not fit into the budget
  std::string name;
#ifdef TESSERA_HAS_VULKAN
  std::unique_ptr<GpuSceneRenderer> onGpu;
  if (const auto context = vulkanContext(device)) {
    GpuRendererSettings settings;
    settings.selection.maximumScreenSpaceError = options.maximumScreenSpaceError;
    settings.budgetBytes = sceneBudgetBytes(device);
    onGpu = openGpuScene(context, scene, settings);
    draw = [&](const BenchmarkView& view) { onGpu->draw(view.camera, view.worldFromCamera); };
    wait = [context] { context->waitIdle(); };
    refused = [&] { return onGpu->state().refused; };
    name = onGpu->device();
  }
#endif
  std::unique_ptr<Device> cpu;
  std::unique_ptr<RenderSource> renderSource;
  if (!draw) {
    cpu = makeDevice({"cpu", options.threads});
    renderSource = openRenderSource(*cpu, scene, options);
    draw = [&](const BenchmarkView& view) { renderSource->renderer().render(view.camera, view.worldFromCamera); };
    name = renderSource->renderer().device();
  }
  const auto timed = [&](const BenchmarkView& view) {
    const auto begun = std::chrono::steady_clock::now();
    draw(view);
    wait();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  };
  double slowest = 0, spent = 0;
  size_t coarser = 0;  // number of views
  for (const BenchmarkView& view : views) {
    draw(view);  // loads what the view needs
    wait();
    if (refused() > 0) ++coarser;
    slowest = std::max(slowest, std::min(timed(view), timed(view)));
  }
  uint64_t frames = 0;
  const auto begun = std::chrono::steady_clock::now();
  while (spent < seconds || frames == 0) {
    for (const BenchmarkView& view : views) draw(view);
    wait();
    frames += views.size();
    spent = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
  }
  return {{"device", name},
          {"width", views[0].camera.width},
          {"height", views[0].camera.height},
          {"views", views.size()},
          {"frames_per_second", static_cast<double>(frames) / spent},
          {"slowest_milliseconds", 1e3 * slowest},
          {"views_drawn_coarser", coarser}};
}

void addBenchFrames(CLI::App& bench) {
  struct Flags {
    std::string scene, views, size = "1920x1080", json;
    DeviceOptions device;
    RenderSourceOptions options{.maximumScreenSpaceError = 1.5};
    double seconds = 3;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = bench.add_subcommand("frames", "pictures a second of a scene");
  verb->footer("Example:\n  tessera bench frames city.scene --views city.capture --device vulkan");
  verb->add_option("scene", flags->scene, "scene folder")->required();
  verb->add_option("--views", flags->views, "draw this capture's held-out views, in turn")->required();
  verb->add_option("--size", flags->size, "of the pictures")->capture_default_str();
  verb->add_option("--detail", flags->options.maximumScreenSpaceError, "pixels of error that may be seen")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0));
  verb->add_option("--seconds", flags->seconds, "how long to repeat")->capture_default_str();
  verb->add_option("--json", flags->json, "write the result as one JSON object here; - prints it");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    int width = 0, height = 0;
    parsePictureSize(flags->size, width, height);
    std::vector<BenchmarkView> views;
    for (const NamedView& view : viewsOfCapture(readCapture(flags->views), Split::test)) {
      views.push_back({view.camera.scaledTo(width, height), view.worldFromCamera});
    }
    flags->options.threads = flags->device.threads;
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const ordered_json json = measureFrames(*device, flags->scene, views, flags->options, flags->seconds);
    if (flags->json != "-") {
      fmt::print("{}\n{} x {}, {} views: {:.1f} pictures a second, the slowest {:.1f} ms\n",
                 json["device"].get<std::string>(), width, height, views.size(),
                 json["frames_per_second"].get<double>(), json["slowest_milliseconds"].get<double>());
    }
    writeJson(flags->json, json);
  });
}

void addBenchCompute(CLI::App& bench) {
  struct Flags {
    RooflineOptions options;
    std::string json;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = bench.add_subcommand("compute", "each operation's rate and its share of the machine's own limit");
  verb->footer("Example:\n  tessera bench compute --json compute.json");
  verb->add_option("--json", flags->json, "write the result as one JSON object here; - prints it");
  verb->add_option("--seconds", flags->options.secondsPerRow, "time for each row")->capture_default_str();
  verb->add_option("--samples", flags->options.samples, "samples of networks and hash grids")
      ->capture_default_str()
      ->check(CLI::Range(32u, 1u << 22));
  verb->add_option("--streamed", flags->options.streamed, "samples of what only streams")
      ->capture_default_str()
      ->check(CLI::Range(32u, 1u << 24));
  addDeviceFlags(*verb, flags->options.device);
  verb->callback([flags] {
    const Roofline roofline = measureRoofline(flags->options);
    if (flags->json != "-") printRoofline(roofline);
    writeJson(flags->json, toJson(roofline));
  });
}

bool hasStepBenchmark(const Method& method) {
  return method.benchmarkStep != nullptr;
}

void addBenchTrain(CLI::App& bench) {
  struct Flags {
    StepBenchmarkOptions options;
    uint32_t samples = 65536;
    DeviceOptions device;
    std::string json;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = bench.add_subcommand("train", "samples per second of a whole training step on fixed samples");
  verb->footer("Example:\n  tessera bench train --threads 2");
  verb->add_option("--samples", flags->samples, "samples of a step, on rays of 32")
      ->capture_default_str()
      ->check(CLI::Range(32u, 1u << 24));
  verb->add_option("--seconds", flags->options.seconds, "how long to repeat")->capture_default_str();
  verb->add_option("--json", flags->json, "write the result as one JSON object here; - prints it");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    flags->options.rays = flags->samples / flags->options.samplesPerRay;
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const StepBenchmark step = firstMethod(hasStepBenchmark).benchmarkStep(*device, flags->options);
    if (flags->json != "-") printStep(device->name(), step);
    writeJson(flags->json, toJson(device->name(), step));
  });
}

}  // namespace

void addBenchVerb(CLI::App& app) {
  CLI::App* bench = app.add_subcommand("bench", "how fast this machine computes, and how fast it could");
  bench->require_subcommand(1);
  addBenchCompute(*bench);
  addBenchFrames(*bench);
  addBenchTrain(*bench);
  addBenchRender(*bench);
}

}  // namespace tessera
