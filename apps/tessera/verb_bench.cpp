#include "apps/tessera/verb_bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "apps/tessera/render_source.h"
#include "apps/tessera/scene_source.h"
#include "apps/tessera/verbs.h"
#include "compute/roofline.h"
#include "eval/render_views.h"
#include "import/capture_reader.h"
#include "render/cpu/scene_benchmark.h"
#include "representations/methods.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "gpu/context.h"
#include "representations/gpu_drawers.h"
#include "tiles/scene_folder.h"
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
    settings.draw.exact = false;
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
  CLI::App* verb = bench.add_subcommand("frames", "frames per second of a scene");
  verb->footer("Example:\n  tessera bench frames city.scene --views city.capture --device vulkan");
  verb->add_option("scene", flags->scene, "scene folder")->required();
  verb->add_option("--views", flags->views, "render this capture's held-out views, in turn")->required();
  verb->add_option("--size", flags->size, "size of the images")->capture_default_str();
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
      fmt::print("{}\n{} x {}, {} views: {:.1f} frames per second, the slowest {:.1f} ms\n",
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
  verb->add_option("--streamed", flags->options.streamed, "samples of operations that memory bandwidth limits")
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

void writeJson(const std::string& file, const ordered_json& json) {
  if (file == "-") {
    fmt::print("{}\n", json.dump(2));
  } else if (!file.empty()) {
    writeFileAtomically(file, json.dump(2) + "\n");
  }
}

void addBenchVerb(CLI::App& app) {
  CLI::App* bench = app.add_subcommand("bench", "how fast this machine computes, and how fast it could");
  bench->require_subcommand(1);
  addBenchCompute(*bench);
  addBenchFrames(*bench);
  addBenchTrain(*bench);
  addBenchRender(*bench);
}

}  // namespace tessera
