#include <fmt/format.h>
#include <unistd.h>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/log.h"
#include "import/capture_reader.h"
#include "representations/methods.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

// Like CLI::Range, but also rejects text that is not a number.
CLI::Validator amount(double low, double high) {
  return CLI::Validator(
      [low, high](const std::string& text) {
        double value = 0;
        const bool within = CLI::detail::lexical_cast(text, value) && value >= low && value <= high;
        return within ? std::string() : fmt::format("{} is not from {} to {}", text, low, high);
      },
      fmt::format("FLOAT in [{} - {}]", low, high));
}

constexpr const char* kAutoBlocks = "auto";

struct TrainFlags {
  std::string method = std::string(methods().front()->name), configFile, blocks = kAutoBlocks, grid;
  std::vector<std::string> settings;
  std::string seed, residentBlocks;
  std::vector<std::string> only;
  DeviceOptions device;
  std::string capture, model;
  TrainingLoopOptions loop;
  double memoryMiB = 0;
  bool json = false;
};

// Returns the defaults of the preset that was requested.
std::unique_ptr<MethodSettings> presetDefaults(const Method& method, const TrainFlags& flags) {
  std::unique_ptr<MethodSettings> settings = method.settings("");
  if (!flags.configFile.empty()) {
    configFromToml(settings->fields(), flags.configFile);
    std::string preset;
    for (const ConfigField& field : settings->fields()) {
      if (field.name == "preset") preset = configValueText(field);
    }
    settings = method.settings(preset);
  }
  constexpr std::string_view kPreset = "preset=";
  for (const std::string& setting : flags.settings) {
    if (setting.starts_with(kPreset)) settings = method.settings(setting.substr(kPreset.size()));
  }
  return settings;
}

// Returns the settings, in order of increasing precedence: defaults (of a preset), the run that is resumed, --config,
// --set.
std::unique_ptr<MethodSettings> chosenSettings(const Method& method, const TrainFlags& flags) {
  std::unique_ptr<MethodSettings> settings = presetDefaults(method, flags), saved;
  if (flags.loop.resume && ModelFolder(flags.model).manifest()) {
    saved = savedSettings(method, flags.model);
    settings = savedSettings(method, flags.model);
  }
  const std::vector<ConfigField> fields = settings->fields();
  if (!flags.configFile.empty()) configFromToml(fields, flags.configFile);
  for (const std::string& setting : flags.settings) setConfigField(fields, setting);
  if (!flags.seed.empty()) setConfigField(fields, "seed=" + flags.seed);
  if (!flags.residentBlocks.empty()) setConfigField(fields, "resident_blocks=" + flags.residentBlocks);
  if (saved) {
    settings->adoptTunedValues(*saved);
    requireSameSettings(flags.model, saved->fields(), fields);
  }
  return settings;
}

bool trainsInBlocks(const Method& method) {
  return method.trainsInBlocks;
}

bool swapsBlocks(const Method& method) {
  return method.swapsBlocks;
}

bool trainsPartsAlone(const Method& method) {
  return method.partsAlone;
}

void takeMethodOfResumedRun(TrainFlags& flags) {
  const auto manifest = flags.loop.resume ? ModelFolder(flags.model).manifest() : std::nullopt;
  if (manifest && findMethod(manifest->method) != nullptr) flags.method = manifest->method;
}

// Throws Error if the model to resume is of another method, whose settings this method could not interpret.
void requireSameMethod(const TrainFlags& flags) {
  const auto manifest = flags.loop.resume ? ModelFolder(flags.model).manifest() : std::nullopt;
  if (!manifest || manifest->method == flags.method) return;
  throw Error((fs::path(flags.model) / "manifest.json").string(), "method",
              fmt::format("the run is of --method {}, not {}", manifest->method, flags.method),
              fmt::format("resume with --method {}", manifest->method));
}

TrainingResult train(Device& device, const TrainFlags& flags) {
  requireSameMethod(flags);
  const Method& method = *findMethod(flags.method);
  const Capture capture = readCapture(flags.capture);
  BlockRunOptions options;
  options.loop = flags.loop;
  options.only = flags.only;
  if (!method.partsAlone && !flags.only.empty()) {
    throw CLI::ValidationError("--only-blocks", "applies to --method " + namesOfMethods(trainsPartsAlone) + " only");
  }
  if (method.trainsInBlocks) {
    const std::optional<BlockCount> blocks = parseBlockCount(flags.blocks);
    if (!blocks) throw CLI::ValidationError("--blocks", "'" + flags.blocks + "' is neither auto nor of the form 2x2");
    options.blocks = *blocks;
    if (!flags.grid.empty()) options.grid = readGrid(flags.grid, capture);
    options.memoryMiB = flags.memoryMiB;
    options.gpuBytes = device.ownMemory().bytes;
    if (!method.swapsBlocks && !flags.residentBlocks.empty()) {
      throw CLI::ValidationError("--resident-blocks", "applies to --method " + namesOfMethods(swapsBlocks) + " only");
    }
  } else {
    const std::string ofOthers = "applies to --method " + namesOfMethods(trainsInBlocks) + " only";
    if (flags.blocks != kAutoBlocks) throw CLI::ValidationError("--blocks", ofOthers);
    if (!flags.grid.empty()) throw CLI::ValidationError("--grid", ofOthers);
    if (flags.memoryMiB > 0) throw CLI::ValidationError("--memory-mib", ofOthers);
  }
  return method.train(device, capture, flags.model, *chosenSettings(method, flags), options);
}

std::vector<std::string> namesOfAllMethods() {
  std::vector<std::string> names;
  for (const Method* method : methods()) names.emplace_back(method->name);
  return names;
}

std::string settingsOfAllMethods() {
  std::string text;
  for (const Method* method : methods()) {
    const bool isFirst = text.empty();
    text += fmt::format("{}Settings of --method {}{}:\n", isFirst ? "" : "\n", method->name,
                        isFirst ? " for --set and --config, with their defaults" : "");
    text += configToToml(method->settings("")->fields());
  }
  return text;
}

std::string howToGoOn(const fs::path& model) {
  if (ModelFolder(model).manifest()) return "go on with --resume";
  return "there is no model yet: repeat the same command, with --resume to keep what was determined so far";
}

// Returns the figures of the steps that have just been performed; nothing if there were none.
std::string describeRates(const TrainingResult& result) {
  if (result.samplesPerSecond <= 0) return {};
  return fmt::format(" in {:.0f} s{}, {:.2f} M samples/s, {:.1f} a ray", result.seconds,
                     result.psnr ? fmt::format(", {:.2f} dB on the training photos", *result.psnr) : "",
                     result.samplesPerSecond / 1e6, result.samplesPerRay);
}

}  // namespace

void addTrainVerb(CLI::App& app) {
  auto flags = std::make_shared<TrainFlags>();
  CLI::App* verb = app.add_subcommand("train", "a capture to a model");
  verb->footer(settingsOfAllMethods() + fmt::format("\nExamples:\n"
                                                    "  tessera train fox.capture fox.model --method {} --minutes 10\n"
                                                    "  tessera train city.capture city.model --method {} --blocks 2x2 "
                                                    "--minutes 15",
                                                    flags->method, firstMethod(trainsInBlocks).name));
  verb->add_option("capture", flags->capture, "capture folder")->required();
  verb->add_option("model", flags->model, "model folder to write")->required();
  const CLI::Option* const method = verb->add_option("--method", flags->method, "representation")
                                        ->default_str(fmt::format("{}, or that of the resumed run", flags->method))
                                        ->check(CLI::IsMember(namesOfAllMethods()));
  CLI::Option* steps =
      verb->add_option("--steps", flags->loop.steps,
                       fmt::format("training steps; of --method {}: of each block", namesOfMethods(trainsPartsAlone)))
          ->default_str(fmt::format("{}, or what the resumed run had planned", kDefaultSteps))
          ->check(CLI::Range(int64_t{1}, int64_t{1} << 40));
  verb->add_option("--minutes", flags->loop.minutes,
                   "train for about this long; the number of steps is fixed early in training")
      ->check(amount(1e-3, 1e7))
      ->excludes(steps);
  verb->add_flag("--resume", flags->loop.resume, "go on with the model that is in the folder");
  const std::string ofBlocks = fmt::format("of --method {}: ", namesOfMethods(trainsInBlocks));
  CLI::Option* blocks =
      verb->add_option("--blocks", flags->blocks, ofBlocks + "auto, or the numbers along x and y, as 3x2")
          ->capture_default_str();
  verb->add_option("--grid", flags->grid, ofBlocks + "the blocks of this blocks.json, of another model")
      ->check(CLI::ExistingFile)
      ->excludes(blocks);
  verb->add_option("--resident-blocks", flags->residentBlocks,
                   fmt::format("of --method {}: number of blocks in memory at once, the others on disk; the same as "
                               "--set resident_blocks=...",
                               namesOfMethods(swapsBlocks)))
      ->check(CLI::Range(1, 1 << 20));
  verb->add_option("--only-blocks", flags->only,
                   fmt::format("of --method {}: train only these, separated by commas, as block_0_1,background; other "
                               "processes may train others. coarse: only what all need first",
                               namesOfMethods(trainsPartsAlone)))
      ->delimiter(',')
      ->transform([](std::string name) { return CLI::detail::trim(name); });
  verb->add_option("--memory-mib", flags->memoryMiB,
                   ofBlocks + "memory for which to plan blocks and photos; default: the machine's")
      ->check(amount(1, 1e9));
  verb->add_option("--seed", flags->seed, "seed of all random numbers, a whole number; the same as --set seed=...");
  verb->add_option("--config", flags->configFile, "settings file (TOML)")->check(CLI::ExistingFile);
  verb->add_option("--set", flags->settings, "key=value; may be repeated");
  verb->add_option("--checkpoint-seconds", flags->loop.checkpointSeconds,
                   "time between checkpoints; default: a minute, or up to 150 s if one takes more than 3 s")
      ->check(amount(0, 1e9));
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags, method] {
    if (method->count() == 0) takeMethodOfResumedRun(*flags);
    catchInterrupts();
    flags->loop.stopRequested = interrupted;
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const TrainingResult result = train(*device, *flags);
    if (flags->json) {
      fmt::print(
          "{{\"step\": {}, \"planned_steps\": {}, \"finished\": {}, \"seconds\": {:.3f}, \"psnr\": {}, "
          "\"samples_per_second\": {:.0f}, \"samples_per_ray\": {:.2f}, \"device\": \"{}\"}}\n",
          result.step, result.plannedSteps, result.finished, result.seconds,
          result.psnr ? fmt::format("{:.4f}", *result.psnr) : "null", result.samplesPerSecond, result.samplesPerRay,
          device->name());
    } else {
      fmt::print("{}: {} of {} steps{}, on {}\n", flags->model, result.step, result.plannedSteps, describeRates(result),
                 device->name());
      if (!result.finished) fmt::print("stopped on request; {}\n", howToGoOn(flags->model));
    }
    // Signals to the shell that training has not finished, so that nothing bakes the model by mistake.
    if (!result.finished) throw CLI::RuntimeError(interruptedStatus());
  });
}

}  // namespace tessera
