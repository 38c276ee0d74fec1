#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/tessera/verbs.h"
#include "compute/roofline.h"
#include "representations/field/step_benchmark.h"

namespace tessera {
namespace {

using nlohmann::ordered_json;

std::string scaled(double value, const std::string& unit) {
  if (value >= 1e9) return fmt::format("{:8.2f} G{}/s", value / 1e9, unit);
  return fmt::format("{:8.2f} M{}/s", value / 1e6, unit);
}

std::string shareOf(const RooflineRow& row) {
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
    fmt::print("  none: they are known for the cpu device only\n");
  }
  fmt::print("\n{:<28} {:<44} {:>9}  {:>17}  {:>17}  {:>7}\n", "operation", "shape", "ms", "rate", "limit", "share");
  for (const RooflineRow& row : roofline.rows) {
    fmt::print("{:<28} {:<44} {:>9.3f}  {:>17}  {:>17}  {}\n", row.name, row.shape, 1e3 * row.seconds,
               scaled(row.rate, row.unit), row.limit > 0 ? scaled(row.limit, row.unit) : "-", shareOf(row));
  }
  fmt::print(
      "\nBest of several runs each. Networks count 2 x weights x samples forward and twice that backward; the hash\n"
      "grid 8 x levels x samples lookups against random gathers from tables of the same sizes; all others the bytes\n"
      "of their arguments, each once, against a copy of the same size. Points on rays revisit what the cache still "
      "holds and may pass the limit.\n");
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
                    {"share", row.limit > 0 ? ordered_json(row.share()) : ordered_json()}});
  }
  return {{"device", roofline.device},
          {"flops_per_second", roofline.limits.flops},
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

// `-` means standard output, with nothing else on it.
void writeJson(const std::string& file, const ordered_json& json) {
  if (file == "-") {
    fmt::print("{}\n", json.dump(2));
  } else if (!file.empty()) {
    writeFileAtomically(file, json.dump(2) + "\n");
  }
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
  addDeviceFlags(*verb, flags->options.device);
  verb->callback([flags] {
    const Roofline roofline = measureRoofline(flags->options);
    if (flags->json != "-") printRoofline(roofline);
    writeJson(flags->json, toJson(roofline));
  });
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
  verb->add_option("--seconds", flags->options.seconds, "repeats for so long")->capture_default_str();
  verb->add_option("--json", flags->json, "write the result as one JSON object here; - prints it");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    flags->options.rays = flags->samples / flags->options.samplesPerRay;
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const StepBenchmark step = benchmarkStep(*device, flags->options);
    if (flags->json != "-") printStep(device->name(), step);
    writeJson(flags->json, toJson(device->name(), step));
  });
}

}  // namespace

void addBenchVerb(CLI::App& app) {
  CLI::App* bench = app.add_subcommand("bench", "how fast this machine computes, and how fast it could");
  bench->require_subcommand(1);
  addBenchCompute(*bench);
  addBenchTrain(*bench);
}

}  // namespace tessera
