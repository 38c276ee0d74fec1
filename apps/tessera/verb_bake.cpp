#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/tessera/verbs.h"
#include "bake/baker.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "import/capture_reader.h"
#include "representations/methods.h"
#include "train/photo_exposures.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

std::string optionName(const BakeParameter& parameter) {
  std::string flag = "--" + std::string(parameter.name);
  std::replace(flag.begin(), flag.end(), '_', '-');
  return flag;
}

CLI::Validator makeMultipleValidator(int64_t unit) {
  return CLI::Validator(
      [unit](const std::string& text) {
        return std::stoll(text) % unit == 0 ? "" : fmt::format("{} is not a multiple of {}", text, unit);
      },
      fmt::format("a multiple of {}", unit));
}

// Replaces a word by its number.
CLI::Validator makeChoiceTransform(std::span<const std::string_view> choices) {
  return CLI::Validator(
      [choices](std::string& text) -> std::string {
        const auto choice = std::find(choices.begin(), choices.end(), text);
        if (choice == choices.end()) return fmt::format("{} is not one of {}", text, fmt::join(choices, ", "));
        text = std::to_string(choice - choices.begin());
        return "";
      },
      fmt::format("{{{}}}", fmt::join(choices, ",")));
}

// One flag for each parameter of any method's bake. Methods that have a parameter of the same name share its flag.
class ParameterFlags {
 public:
  void addTo(CLI::App& verb) {
    for (const Method* method : methods()) {
      for (const BakeParameter& parameter : method->bakeParameters) {
        if (!given_.contains(parameter.name)) add(verb, parameter);
      }
    }
  }

  // Throws Error if a parameter was given that the method does not have.
  BakeParameters of(const Method& method) const {
    BakeParameters chosen;
    for (const BakeParameter& parameter : method.bakeParameters) {
      const std::optional<int64_t>& given = given_.at(parameter.name);
      if (given || parameter.standard) chosen.emplace(parameter.name, given.value_or(parameter.standard.value_or(0)));
    }
    for (const auto& [name, value] : given_) {
      if (!value || chosen.contains(name)) continue;
      throw Error(optionName({.name = name}), "", "is for models of --method " + methodsWith(name), "leave it out");
    }
    return chosen;
  }

 private:
  static std::string methodsWith(std::string_view name) {
    std::string names;
    for (const Method* method : methods()) {
      for (const BakeParameter& parameter : method->bakeParameters) {
        if (parameter.name == name) names += (names.empty() ? "" : " or ") + std::string(method->name);
      }
    }
    return names;
  }

  void add(CLI::App& verb, const BakeParameter& parameter) {
    std::optional<int64_t>& given = given_[parameter.name];
    CLI::Option* option = verb.add_option(optionName(parameter), given,
                                          fmt::format("of {}: {}", methodsWith(parameter.name), parameter.help));
    if (!parameter.choices.empty()) {
      if (parameter.standard)
        option->default_str(std::string(parameter.choices[static_cast<size_t>(*parameter.standard)]));
      option->type_name("TEXT")->transform(makeChoiceTransform(parameter.choices));
      return;
    }
    if (parameter.standard) option->default_str(std::to_string(*parameter.standard));
    option->check(CLI::Range(parameter.minimum, parameter.maximum));
    if (parameter.divisibleBy > 1) option->check(makeMultipleValidator(parameter.divisibleBy));
  }

  std::map<std::string_view, std::optional<int64_t>> given_;
};

}  // namespace

void addBakeVerb(CLI::App& app) {
  struct Flags {
    std::string model, scene, capture;
    BakeOptions options;
    ParameterFlags parameters;
    DeviceOptions device;
    bool json = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("bake", "a trained model to a scene of tiles");
  verb->footer("Example:\n  tessera bake city.model city.scene");
  verb->add_option("model", flags->model, "model folder, of --method " + namesOfMethods(isBaked, "or"))->required();
  verb->add_option("scene", flags->scene, "scene folder to write")->required();
  verb->add_option("--capture", flags->capture,
                   "capture that the model was trained on; default: its path at training time");
  verb->add_option("--name", flags->options.name,
                   "name of the scene, for its title and for exports; default: that of the capture's folder");
  verb->add_option("--stride", flags->options.stride,
                   "use every n-th pixel of rows and columns to find what is visible")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
  verb->add_option("--background", flags->options.background,
                   "red, green and blue for directions that no photo shows; default: a hazy sky")
      ->check(CLI::Range(0.0, 1.0));
  flags->parameters.addTo(*verb);
  verb->add_option("--effort", flags->options.effort, "compression effort")
      ->capture_default_str()
      ->check(CLI::Range(0, 9));
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    const ModelFolder folder(flags->model);
    const ModelManifest manifest = requireManifest(folder);
    const std::string& name = manifest.method;
    const Method* method = findMethod(name);
    if (method == nullptr || !isBaked(*method)) {
      throw Error(flags->model, "", "is a model of " + name + ", which is not baked",
                  "train with --method " + namesOfMethods(isBaked, "or"));
    }
    refuseFolderForScene(flags->scene);
    const BakeParameters parameters = flags->parameters.of(*method);
    // Parts that are trained by themselves are checked by their baker.
    if (!method->partsAlone && (manifest.plannedSteps == 0 || manifest.step < manifest.plannedSteps)) {
      warn("{}: its training was interrupted after {} steps; go on with tessera train ... --resume, then bake again",
           flags->model, manifest.step);
    }
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const Capture capture =
        readCapture(flags->capture.empty() ? folder.readPlacement().capture.string() : flags->capture);
    requireSameWorld(folder, capture);
    const std::unique_ptr<Baker> baker = method->openBaker(*device, flags->model, parameters);
    Progress progress("baking", 0, "steps");
    flags->options.onStep = [&](int64_t done, int64_t all) {
      progress.setTotal(all);
      progress.update(done);
    };
    flags->options.exposureResponse = readExposureResponse(folder);
    const BakedScene baked = bakeScene(*baker, capture, flags->scene, flags->options);
    progress.finish();
    if (flags->json) {
      nlohmann::ordered_json result = {{"tiles", baked.tileset.tiles.size()}};
      for (const BakedLevel& level : baked.levels) {
        nlohmann::ordered_json& of = result["levels"].emplace_back();
        of = {{"bytes_on_disk", level.bytesOnDisk}, {"bytes_in_memory", level.bytesInMemory}};
        for (const auto& [what, count] : level.counts) of[what] = count;
      }
      fmt::print("{}\n", result.dump(2));
      return;
    }
    for (size_t level = 0; level < baked.levels.size(); ++level) {
      const BakedLevel& of = baked.levels[level];
      fmt::print("{}, level {}: {:.1f} MB on disk, {:.1f} MB in memory", flags->scene, level,
                 static_cast<double>(of.bytesOnDisk) / 1e6, static_cast<double>(of.bytesInMemory) / 1e6);
      for (const auto& [what, count] : of.counts) fmt::print(", {} {}", count, what);
      fmt::print("\n");
    }
  });
}

}  // namespace tessera
