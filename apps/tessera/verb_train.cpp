#include <fmt/format.h>
#include <unistd.h>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/log.h"
#include "import/capture_reader.h"
#include "representations/field/train_field.h"

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

}  // namespace

void addTrainVerb(CLI::App& app) {
  struct Flags {
    std::string method = "field", configFile;
    std::vector<std::string> settings;
    std::string seed;
    DeviceOptions device;
    std::string capture, model;
    TrainFieldOptions options;
    bool json = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("train", "a capture to a model");
  FieldConfig defaults;
  verb->footer("Settings for --set and --config, with their defaults:\n" + configToToml(defaults.fields()) +
               "\nExample:\n  tessera train fox.capture fox.model --method field --minutes 10");
  verb->add_option("capture", flags->capture, "capture folder")->required();
  verb->add_option("model", flags->model, "model folder to write")->required();
  verb->add_option("--method", flags->method, "representation")->capture_default_str()->check(CLI::IsMember({"field"}));
  CLI::Option* steps = verb->add_option("--steps", flags->options.loop.steps, "training steps")
                           ->capture_default_str()
                           ->check(CLI::Range(int64_t{1}, int64_t{1} << 40));
  verb->add_option("--minutes", flags->options.loop.minutes, "as many steps as fit; fixed once, early")
      ->check(amount(1e-3, 1e7))
      ->excludes(steps);
  verb->add_flag("--resume", flags->options.loop.resume, "go on with the model that is in the folder");
  verb->add_option("--seed", flags->seed, "of everything random, a whole number; the same as --set seed=...");
  verb->add_option("--config", flags->configFile, "settings file (TOML)")->check(CLI::ExistingFile);
  verb->add_option("--set", flags->settings, "key=value, as often as wanted");
  verb->add_option("--checkpoint-seconds", flags->options.loop.checkpointSeconds, "time between checkpoints")
      ->capture_default_str()
      ->check(amount(0, 1e9));
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  addDeviceFlags(*verb, flags->device);
  flags->options.loop.steps = 10000;
  verb->callback([flags] {
    FieldConfig& config = flags->options.config;
    if (flags->options.loop.resume) config = resumedFieldConfig(flags->model);
    if (!flags->configFile.empty()) configFromToml(config.fields(), flags->configFile);
    for (const std::string& setting : flags->settings) setConfigField(config.fields(), setting);
    if (!flags->seed.empty()) setConfigField(config.fields(), "seed=" + flags->seed);
    if (flags->options.loop.resume) requireSameConfig(flags->model, config);
    catchInterrupts();
    flags->options.loop.stopRequested = interrupted;
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const TrainingResult result = trainField(*device, readCapture(flags->capture), flags->model, flags->options);
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
      if (!result.finished) fmt::print("stopped on request; go on with --resume\n");
    }
  });
}

}  // namespace tessera
