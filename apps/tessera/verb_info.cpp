#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "apps/tessera/folder_kind.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "compute/device.h"
#include "import/capture_reader.h"
#include "import/importer.h"
#include "representations/codecs.h"
#include "representations/methods.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

using nlohmann::ordered_json;

ordered_json describeCapture(const fs::path& folder) {
  const Capture capture = readCapture(folder);
  ordered_json info = {{"kind", "capture"},
                       {"photos", capture.photos.size()},
                       {"train", capture.photosIn(Split::train).size()},
                       {"validation", capture.photosIn(Split::validation).size()},
                       {"test", capture.photosIn(Split::test).size()},
                       {"points", capture.points.size()},
                       {"observations", capture.observations.size()},
                       {"cameras", ordered_json::array()}};
  for (const Camera& camera : capture.cameras) {
    info["cameras"].push_back({{"lens", lensName(camera.lens)}, {"width", camera.width}, {"height", camera.height}});
  }
  if (capture.geo) {
    info["origin"] = {{"latitude", capture.geo->latitude},
                      {"longitude", capture.geo->longitude},
                      {"altitude", capture.geo->altitude}};
  }
  return info;
}

void addCoverage(ordered_json& info, const std::vector<SurfaceCoverage>& coverage) {
  for (const SurfaceCoverage& part : coverage)
    info["coverage"][part.part] = {{"pixels", part.pixels}, {"holes", part.holes}, {"share", part.share()}};
}

ordered_json describeModel(const fs::path& folder) {
  const ModelFolder model(folder);
  const std::optional<ModelManifest> manifest = model.manifest();
  const ModelPlacement placement = model.readPlacement();
  const Method* planned = findMethod(placement.method);  // of a model that has saved nothing yet
  const Method& method = manifest             ? findModelMethod(model, *manifest)
                         : planned != nullptr ? *planned
                                              : *methods().front();
  ordered_json info = {{"kind", "model"},
                       {"method", method.name},
                       {"step", manifest ? manifest->step : 0},
                       {"planned_steps", manifest ? manifest->plannedSteps : 0},
                       {"capture", placement.capture.string()}};
  const std::unique_ptr<MethodSettings> settings = savedSettings(method, folder);
  if (method.trainsInBlocks) {
    info["blocks"] = {{"columns", placement.grid ? placement.grid->columns : 0},
                      {"rows", placement.grid ? placement.grid->rows : 0},
                      {"edge", placement.grid ? placement.grid->edge : 0}};
  }
  for (const auto& [key, number] : method.describe(*settings)) info[key] = number;
  if (manifest) addCoverage(info, readCoverage(method, folder));
  for (const ConfigField& field : settings->fields()) info["config"][std::string(field.name)] = configValueText(field);
  return info;
}

ordered_json makeSizeJson(uint64_t contents, uint64_t onDisk, uint64_t inMemory) {
  return {{"contents", contents}, {"bytes_on_disk", onDisk}, {"bytes_in_memory", inMemory}};
}

ordered_json describeScene(const fs::path& folder) {
  const Tileset tileset = readTileset(folder);
  struct Sizes {
    uint64_t contents = 0, onDisk = 0, inMemory = 0;
  };
  const ContentCodec& codec = requireCodec(folder, tileset);
  std::vector<Sizes> levels(tileset.levels), backgroundBlocks(tileset.levels);
  std::set<uint32_t> resources;
  for (size_t tile = 0; tile < tileset.tiles.size(); ++tile) {
    for (const TileContent& content : tileset.tiles[tile].contents) {
      Sizes& sizes = content.backgroundBlock ? backgroundBlocks[content.level] : levels[tileset.tiles[tile].level];
      ++sizes.contents;
      const fs::path file = contentPath(folder, content.uri);
      sizes.onDisk += fs::file_size(file);
      sizes.inMemory += readDecodedBytes(file, codec);
      resources.insert(content.resources.begin(), content.resources.end());
    }
  }
  Sizes shared;
  for (const uint32_t number : resources) {
    const fs::path file = contentPath(folder, tileset.resources[number].uri);
    shared.onDisk += fs::file_size(file);
    shared.inMemory += readResourceBytes(file, codec, tileset.resources[number]);
  }
  ordered_json info = {
      {"kind", "scene"},
      {"representation", tileset.representation},
      {"name", tileset.name},
      {"blocks", {{"columns", tileset.columns}, {"rows", tileset.rows}, {"edge", tileset.blockGrid().edge}}}};
  const auto describe = [&](const char* what, const std::vector<Sizes>& all) {
    for (size_t level = 0; level < all.size(); ++level) {
      const Sizes& sizes = all[level];
      if (sizes.contents == 0) continue;  // a root that only groups the others
      info[fmt::format("{}_{}", what, level)] = makeSizeJson(sizes.contents, sizes.onDisk, sizes.inMemory);
    }
  };
  describe("level", levels);
  describe("background_block", backgroundBlocks);
  if (!resources.empty()) {
    info["shared_resources"] = {
        {"files", resources.size()}, {"bytes_on_disk", shared.onDisk}, {"bytes_in_memory", shared.inMemory}};
  }
  addCoverage(info, tileset.coverage);
  return info;
}

ordered_json describe(const fs::path& folder) {
  switch (kindOfFolder(folder)) {
    case FolderKind::source:
      return {{"kind", "source"}, {"format", sourceFormat(folder)}};
    case FolderKind::capture:
      return describeCapture(folder);
    case FolderKind::model:
      return describeModel(folder);
    case FolderKind::scene:
      return describeScene(folder);
    case FolderKind::other:
      break;
  }
  throw Error(folder.string(), "", "holds nothing that tessera knows", "name a source, capture, model or scene folder");
}

// Describes the values that --device accepts on this machine.
ordered_json describeDevices() {
  ordered_json info = {{"kind", "devices"}};
  for (const DeviceDescription& device : listDevices()) {
    ordered_json& about = info[device.kind];
    if (!device.name.empty()) about["name"] = device.name;
    if (device.memoryBytes > 0) about["memory_bytes"] = device.memoryBytes;
    if (!device.features.empty()) about["features"] = fmt::format("{}", fmt::join(device.features, ", "));
    if (!device.missing.empty()) about["cannot_be_used"] = device.missing;
  }
  return info;
}

void printIndented(const ordered_json& info, int indent) {
  for (const auto& [key, value] : info.items()) {
    if (value.is_object()) {
      fmt::print("{:{}}{}:\n", "", indent, key);
      printIndented(value, indent + 2);
    } else {
      fmt::print("{:{}}{:<16} {}\n", "", indent, key, value.is_string() ? value.get<std::string>() : value.dump());
    }
  }
}

}  // namespace

void addInfoVerb(CLI::App& app) {
  struct Flags {
    std::string what;
    bool json = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand(
      "info", "what a folder is and holds: source, capture, model or scene; or the devices of this machine");
  verb->footer("Examples:\n  tessera info fox.model --json\n  tessera info devices");
  verb->add_option("what", flags->what, "a folder, or the word devices")->required();
  verb->add_flag("--json", flags->json, "as one JSON object");
  verb->callback([flags] {
    const fs::path folder = flags->what;
    const bool ofDevices = flags->what == "devices" && !fs::exists(folder);
    if (!ofDevices && !fs::is_directory(folder))
      throw Error(flags->what, "", "is not a folder", "name a source, capture, model or scene");
    const ordered_json info = ofDevices ? describeDevices() : describe(folder);
    if (flags->json) {
      fmt::print("{}\n", info.dump(2));
    } else {
      printIndented(info, 0);
    }
  });
}

}  // namespace tessera
