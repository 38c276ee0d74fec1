#include <fmt/format.h>
#include <unistd.h>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/log.h"
#include "import/capture_reader.h"
#include "representations/field/train_field.h"
#include "representations/hash/train_hash.h"
#include "representations/volume/train_volume.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

// As CLI::Range, but false for what is not a number.
CLI::Validator amount(double low, double high) {
  return CLI::Validator(
      [low, high](const std::string& text) {
        double value = 0;
        const bool within = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
        return within ? std::string() : fmt::format("{} is not from {} to {}", text, low, high);
      },
      fmt::format("FLOAT in [{} - {}]", low, high));
}

struct TrainFlags {
  std::string method = "field", configFile, blocks = "auto", grid;
  std::vector<std::string> settings;
  std::string seed, residentBlocks;
  DeviceOptions device;
  std::string capture, model;
  TrainingLoopOptions loop;
  double memoryMiB = 0;
  bool json = false;
};

// Settings in the order of their strength: defaults (of a preset), the run that is resumed, --config, --set.
template <class Config>
Config chosenConfig(const TrainFlags& flags, Config config) {
  if (flags.loop.resume && ModelFolder(flags.model).manifest()) config = savedConfig<Config>(flags.model);
  if (!flags.configFile.empty()) configFromToml(config.fields(), flags.configFile);
  for (const std::string& setting : flags.settings) setConfigField(config.fields(), setting);
  if (!flags.seed.empty()) setConfigField(config.fields(), "seed=" + flags.seed);
  if (!flags.residentBlocks.empty()) setConfigField(config.fields(), "resident_blocks=" + flags.residentBlocks);
  if (flags.loop.resume && ModelFolder(flags.model).manifest()) {
    if constexpr (requires { config.keepFound(config); }) config.keepFound(savedConfig<Config>(flags.model));
  }
  if (flags.loop.resume) requireSameConfig(flags.model, config);
  return config;
}

// Of the preset that is asked for.
template <class Config>
Config presetDefaults(const TrainFlags& flags) {
  Config config;
  if (!flags.configFile.empty()) {
    configFromToml(config.fields(), flags.configFile);
    config = Config::ofPreset(config.preset);
  }
  constexpr std::string_view kPreset = "preset=";
  for (const std::string& setting : flags.settings) {
    if (setting.starts_with(kPreset)) config = Config::ofPreset(setting.substr(kPreset.size()));
  }
  return config;
}

// Its settings would not even be understood.
void requireSameMethod(const TrainFlags& flags) {
  const auto manifest = flags.loop.resume ? ModelFolder(flags.model).manifest() : std::nullopt;
  if (!manifest || manifest->method == flags.method) return;
  throw Error((fs::path(flags.model) / "manifest.json").string(), "method",
              fmt::format("the run is of --method {}, not {}", manifest->method, flags.method),
              fmt::format("resume with --method {}", manifest->method));
}

TrainingResult train(Device& device, const TrainFlags& flags) {
  requireSameMethod(flags);
  const Capture capture = readCapture(flags.capture);
  if (flags.method == "field") {
    if (!flags.grid.empty()) throw CLI::ValidationError("--grid", "is of --method volume and hash");
    if (flags.memoryMiB > 0) throw CLI::ValidationError("--memory-mib", "is of --method volume and hash");
    return trainField(device, capture, flags.model, {chosenConfig(flags, FieldConfig()), flags.loop});
  }
  const std::optional<BlockCount> blocks = parseBlockCount(flags.blocks);
  if (!blocks) throw CLI::ValidationError("--blocks", "'" + flags.blocks + "' is neither auto nor of the form 2x2");
  std::optional<BlockGrid> grid;
  if (!flags.grid.empty()) grid = readGrid(flags.grid, capture);
  const BlockRunOptions options{flags.loop, *blocks, grid, flags.memoryMiB, device.ownMemory().bytes};
  if (flags.method == "hash") {
    if (!flags.residentBlocks.empty()) throw CLI::ValidationError("--resident-blocks", "is of --method volume");
    return trainHash(device, capture, flags.model, {options, chosenConfig(flags, presetDefaults<HashConfig>(flags))});
  }
  return trainVolume(device, capture, flags.model, {options, chosenConfig(flags, presetDefaults<VolumeConfig>(flags))});
}

std::string howToGoOn(const fs::path& model) {
  if (ModelFolder(model).manifest()) return "go on with --resume";
  return "there is no model yet: give the same command again, with --resume for what was found out so far";
}

}  // namespace

void addTrainVerb(CLI::App& app) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* verb = app.add_subcommand("train", "a capture to a model");
  verb->footer("Settings of --method field for --set and --config, with their defaults:\n" +
               configToToml(FieldConfig().fields()) + "\nSettings of --method volume:\n" +
               configToToml(VolumeConfig().fields()) + "\nSettings of --method hash:\n" +
               configToToml(HashConfig().fields()) +
               "\nExamples:\n  tessera train fox.capture fox.model --method field --minutes 10\n"
               "  tessera train city.capture city.model --method volume --blocks 2x2 --minutes 15");
  verb->add_option("capture", flags->capture, "capture folder")->required();
  verb->add_option("model", flags->model, "model folder to write")->required();
  verb->add_option("--method", flags->method, "representation")
      ->capture_default_str()
      ->check(CLI::IsMember({"field", "volume", "hash"}));
  CLI::Option* steps = verb->add_option("--steps", flags->loop.steps, "training steps")
                           ->default_str(fmt::format("{}, or what the run that is resumed had planned", kDefaultSteps))
                           ->check(CLI::Range(int64_t{1}, int64_t{1} << 40));
  verb->add_option("--minutes", flags->loop.minutes, "as many steps as fit; fixed once, early")
      ->check(amount(1e-3, 1e7))
      ->excludes(steps);
  verb->add_flag("--resume", flags->loop.resume, "go on with the model that is in the folder");
  CLI::Option* blocks =
      verb->add_option("--blocks", flags->blocks, "of --method volume and hash: auto, or so many along x and y, as 3x2")
          ->capture_default_str();
  verb->add_option("--grid", flags->grid,
                   "of --method volume and hash: the blocks of this blocks.json, of another model")
      ->check(CLI::ExistingFile)
      ->excludes(blocks);
  verb->add_option("--resident-blocks", flags->residentBlocks,
                   "of --method volume: so many blocks in memory at once, the others on disk; the same as --set "
                   "resident_blocks=...")
      ->check(CLI::Range(1, 1 << 20));
  verb->add_option("--memory-mib", flags->memoryMiB,
                   "of --method volume and hash: memory to plan blocks and photos for; default: what the machine has")
      ->check(amount(1, 1e9));
  verb->add_option("--seed", flags->seed, "of everything random, a whole number; the same as --set seed=...");
  verb->add_option("--config", flags->configFile, "settings file (TOML)")->check(CLI::ExistingFile);
  verb->add_option("--set", flags->settings, "key=value, as often as wanted");
  verb->add_option("--checkpoint-seconds", flags->loop.checkpointSeconds, "time between checkpoints")
      ->capture_default_str()
      ->check(amount(0, 1e9));
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    catchInterrupts();
    flags->loop.stopRequested = interrupted;
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const TrainingResult result = train(*device, *flags);
    if (flags->json) {
      fmt::print(
          "{{\"step\": {}, \"planned_steps\": {}, \"finished\": {}, \"seconds\": {:.3f}, \"psnr\": {:.4f}, "
          "\"samples_per_second\": {:.0f}, \"device\": \"{}\"}}\n",
          result.step, result.plannedSteps, result.finished, result.seconds, result.psnr, result.samplesPerSecond,
          device->name());
    } else {
      fmt::print("{}: {} of {} steps in {:.0f} s, {:.2f} dB on the training photos, {:.2f} M samples/s on {}\n",
                 flags->model, result.step, result.plannedSteps, result.seconds, result.psnr,
                 result.samplesPerSecond / 1e6, device->name());
      if (!result.finished) fmt::print("stopped on request; {}\n", howToGoOn(flags->model));
    }
    // Whoever is to bake it next is told.
    if (!result.finished) throw CLI::RuntimeError(interruptedStatus());
  });
}

}  // namespace tessera
