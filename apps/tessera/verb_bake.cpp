#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/progress.h"
#include "import/capture_reader.h"
#include "representations/hash/bake_hash.h"
#include "representations/volume/bake_volume.h"
#include "representations/volume/train_volume.h"
#include "tiles/hash_payload.h"
#include "train/level_folders.h"
#include "train/run_folder.h"

namespace tessera {

void addBakeVerb(CLI::App& app) {
  struct Flags {
    std::string model, scene, capture;
    BakeHashOptions options;
    std::optional<uint32_t> residentBlocks;
    DeviceOptions device;
    bool json = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("bake", "a trained model to a scene of tiles");
  verb->footer("Example:\n  tessera bake city.model city.scene");
  verb->add_option("model", flags->model, "model folder, of --method volume or hash")->required();
  verb->add_option("scene", flags->scene, "scene folder to write")->required();
  verb->add_option("--capture", flags->capture, "what the model was trained on; default: where it was then");
  verb->add_option("--stride", flags->options.stride,
                   "look at every so manieth pixel of rows and columns to find what is seen")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
  verb->add_option("--resident-blocks", flags->residentBlocks,
                   "of volume: blocks of the model in memory at once, besides a surround of its own; 0: all; default: "
                   "as many as "
                   "in training")
      ->check(CLI::Range(0, 1 << 20));
  verb->add_option("--background", flags->options.background,
                   "red, green and blue where no photo looked; default: a hazy sky")
      ->check(CLI::Range(0.0, 1.0));
  verb->add_option("--cells", flags->options.cells,
                   "of hash: cells of a block's occupancy along an edge, a multiple of 8; 0: three times the "
                   "lattice's, up to 384 or the lattice's")
      ->capture_default_str()
      ->check(CLI::Range(0u, kMostOccupancyCells))
      ->check(CLI::Validator(
          [](const std::string& text) {
            return std::stoul(text) % HashPart::kOccupancyUnit == 0 ? "" : text + " is no multiple of 8";
          },
          "a multiple of 8"));
  verb->add_option("--dilation", flags->options.dilation, "of hash: cells around those that are seen are kept, too")
      ->capture_default_str()
      ->check(CLI::Range(0, 8));
  verb->add_option("--effort", flags->options.effort, "of compression")->capture_default_str()->check(CLI::Range(0, 9));
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    const ModelFolder folder(flags->model);
    const std::string method = requireManifest(folder).method;
    if (method != "volume" && method != "hash") {
      throw Error(flags->model, "", "is a model of " + method + ", which is not baked",
                  "train with --method volume or hash");
    }
    if (method == "hash" && flags->residentBlocks) {
      throw Error("--resident-blocks", "", "is for models of --method volume", "leave it out");
    }
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const Capture capture =
        readCapture(flags->capture.empty() ? folder.readPlacement().capture.string() : flags->capture);
    requireSameWorld(folder, capture);
    const uint32_t levels =
        method == "hash" ? trainedLevels<HashConfig>(flags->model) : trainedLevels<VolumeConfig>(flags->model);
    Progress progress("baking", static_cast<int64_t>(levels * capture.photosIn(Split::train).size()), "photos");
    flags->options.onPhoto = [&](int64_t done, int64_t) { progress.update(done); };
    BakedScene baked;
    if (method == "volume") {
      const VolumeConfig config = savedConfig<VolumeConfig>(flags->model);
      const uint32_t resident = flags->residentBlocks.value_or(static_cast<uint32_t>(config.residentBlocks));
      const LevelModels models = [&](uint32_t level) {
        return loadVolumeModel(*device, levelFolder(flags->model, level), resident);
      };
      baked = bakeVolume(models, levels, capture, flags->scene, flags->options);
    } else {
      const HashLevelModels models = [&](uint32_t level) {
        return loadHashModel(*device, levelFolder(flags->model, level));
      };
      baked = bakeHash(models, levels, capture, flags->scene, flags->options);
    }
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
