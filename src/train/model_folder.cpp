#include "train/model_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <unordered_set>

#include "base/check.h"
#include "base/error.h"
#include "scene/block_grid_json.h"

namespace tessera {
namespace {

using nlohmann::json;

json parseJson(const fs::path& path) {
  const std::string text = readTextFile(path);
  json parsed = json::parse(text, nullptr, false);
  if (parsed.is_discarded() || !parsed.is_object()) {
    throw Error(path.string(), "", "is not a JSON object", "restore the file or train again");
  }
  return parsed;
}

Mat4d sourceFromWorldIn(const json& placement) {
  Mat4d matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = placement.at("source_from_world").at(i).get<double>();
  return matrix;
}

bool isSameWorld(const Mat4d& a, const Mat4d& b) {
  return (a - b).norm() <= 1e-9 * b.norm();
}

}  // namespace

std::optional<ModelManifest> ModelFolder::manifest() const {
  const fs::path path = root_ / "manifest.json";
  if (!fs::exists(path)) return std::nullopt;
  const json parsed = parseJson(path);
  ModelManifest manifest;
  try {
    manifest.method = parsed.at("method").get<std::string>();
    manifest.step = parsed.at("step").get<int64_t>();
    manifest.plannedSteps = parsed.at("planned_steps").get<int64_t>();
    manifest.seconds = parsed.value("seconds", 0.0);
    manifest.savingSeconds = parsed.value("saving_seconds", 0.0);
    manifest.minutes = parsed.value("minutes", 0.0);
    for (const json& file : parsed.at("files")) manifest.files.push_back(file.get<std::string>());
  } catch (const json::exception& error) {
    throw Error(path.string(), "", error.what(), "restore the file or train again");
  }
  const bool areTimes =
      manifest.savingSeconds >= 0 && manifest.seconds >= manifest.savingSeconds && manifest.minutes >= 0;
  if (manifest.files.empty() || manifest.step < 0 || manifest.plannedSteps < 0 || !areTimes) {
    throw Error(path.string(), "", "names no checkpoint, or a step or a time below zero",
                "restore the file or train again");
  }
  for (const std::string& file : manifest.files) {
    const std::optional<fs::path> inside = resolveInside(root_, file);
    if (!inside || !fs::exists(*inside)) {
      throw Error(path.string(), "files", "names '" + file + "', which is not there",
                  "restore the file, or train into another folder");
    }
  }
  return manifest;
}

namespace {

// Removes all but the last `keep` checkpoints up to `step`, and the files that a killed run left behind.
void removeOld(const fs::path& folder, int64_t step, int keep) {
  std::vector<std::pair<int64_t, fs::path>> old;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename().string();
    if (file.starts_with("step-") && file.ends_with(".safetensors")) {
      const int64_t itsStep = std::atoll(file.c_str() + 5);
      if (itsStep > step) {
        fs::remove(entry.path());  // of a run that was killed before it wrote its manifest
      } else {
        old.emplace_back(itsStep, entry.path());
      }
    } else if (file.find(".partial-") != std::string::npos) {
      fs::remove(entry.path());  // of a run that was killed while writing
    }
  }
  std::sort(old.begin(), old.end());
  for (size_t i = 0; i + static_cast<size_t>(keep) < old.size(); ++i) fs::remove(old[i].second);
}

}  // namespace

void ModelFolder::writeManifest(const ModelManifest& manifest) const {
  json text = {{"method", manifest.method},
               {"step", manifest.step},
               {"planned_steps", manifest.plannedSteps},
               {"files", manifest.files}};
  // Only then: the same steps have the same manifest, however long they took.
  if (manifest.plannedSteps == 0 && manifest.seconds > 0) {
    text["seconds"] = manifest.seconds;
    text["saving_seconds"] = manifest.savingSeconds;
    text["minutes"] = manifest.minutes;
  }
  writeFileAtomically(root_ / "manifest.json", text.dump(2) + "\n", true);
}

void ModelFolder::commit(const ModelManifest& state, uint32_t parts,
                         const std::function<std::optional<Bytes>(uint32_t)>& save, int keep) const {
  std::optional<ModelManifest> before;
  ModelManifest now = state;
  now.files.clear();
  for (uint32_t part = 0; part < parts; ++part) {
    const std::optional<Bytes> bytes = save(part);
    if (!bytes) {
      if (!before) before = manifest();
      CHECK(before.has_value());
      CHECK(part < before->files.size());
      now.files.push_back(before->files[part]);
      continue;
    }
    const std::string name = fmt::format("blocks/{}/step-{}.safetensors", part, state.step);
    writeFileAtomically(root_ / name, *bytes, true);
    now.files.push_back(name);
  }
  writeManifest(now);
  for (uint32_t part = 0; part < parts; ++part) removeOld(root_ / "blocks" / std::to_string(part), state.step, keep);
}

void ModelFolder::writePlacement(const ModelPlacement& placement, const std::string& method) const {
  const Vec3d& centre = placement.frame.centre;
  json sourceFromWorld = json::array();
  for (int i = 0; i < 16; ++i) sourceFromWorld.push_back(placement.sourceFromWorld(i / 4, i % 4));
  json blocks =
      json::array({{{"id", "0"}, {"centre", {centre.x(), centre.y(), centre.z()}}, {"scale", placement.frame.scale}}});
  if (placement.grid) {
    blocks.clear();
    for (int cell = 0; cell < placement.grid->cells(); ++cell) {
      const Vec2d inGrid = placement.grid->centre(cell);
      const Vec3d inWorld = placement.grid->inWorld({inGrid.x(), inGrid.y(), 0});
      blocks.push_back({{"id", std::to_string(cell)}, {"centre", {inWorld.x(), inWorld.y(), inWorld.z()}}});
    }
  }
  json text = {{"method", method},
               {"capture", fs::absolute(placement.capture).lexically_normal().string()},
               {"source_from_world", sourceFromWorld},
               {"trained_on", placement.trainedOn},
               {"blocks", blocks}};
  if (placement.grid) text["grid"] = blockGridToJson(*placement.grid);
  writeFileAtomically(root_ / "blocks.json", text.dump(2) + "\n");
}

ModelPlacement ModelFolder::readPlacement() const {
  const fs::path path = root_ / "blocks.json";
  const json parsed = parseJson(path);
  try {
    ModelPlacement placement;
    if (parsed.contains("grid")) {
      placement.grid = blockGridFromJson(parsed["grid"]);
      if (!placement.grid)
        throw Error(path.string(), "grid", "is not a grid of blocks", "restore the file or train again");
    } else {
      const json& block = parsed.at("blocks").at(0);
      for (int axis = 0; axis < 3; ++axis) {
        placement.frame.centre[axis] = block.at("centre").at(axis).get<double>();
      }
      placement.frame.scale = block.at("scale").get<double>();
    }
    placement.sourceFromWorld = sourceFromWorldIn(parsed);
    placement.capture = parsed.at("capture").get<std::string>();
    placement.trainedOn = parsed.at("trained_on").get<std::vector<std::string>>();
    placement.method = parsed.value("method", "");
    return placement;
  } catch (const json::exception& error) {
    throw Error(path.string(), "", error.what(), "restore the file or train again");
  }
}

void ModelFolder::writePlan(const StepPlan& plan) const {
  writeFileAtomically(root_ / "plan.json",
                      json({{"steps", plan.steps}, {"planned_at_step", plan.plannedAtStep}}).dump() + "\n", true);
}

std::optional<StepPlan> ModelFolder::readPlan() const {
  const fs::path path = root_ / "plan.json";
  if (!fs::exists(path)) return std::nullopt;
  const json parsed = parseJson(path);
  const auto number = [&](const char* key, int64_t minimum) {
    if (!parsed.is_object() || !parsed.contains(key) || !parsed[key].is_number_integer() ||
        parsed[key].get<int64_t>() < minimum) {
      throw Error(path.string(), key, fmt::format("is not a whole number from {} on", minimum), "remove the file");
    }
    return parsed[key].get<int64_t>();
  };
  return StepPlan{number("steps", 1), number("planned_at_step", 0)};
}

void ModelFolder::appendMetrics(const json& line) const {
  std::ofstream out(metricsPath(), std::ios::app);
  out << line.dump() << '\n';
  out.flush();
  if (!out) throw Error(metricsPath().string(), "", "could not be written", "check free space and permissions");
}

void ModelFolder::cutMetrics(int64_t step) const {
  if (!fs::exists(metricsPath())) return;
  std::string remaining;
  std::ifstream in(metricsPath());
  for (std::string line; std::getline(in, line);) {
    const json parsed = json::parse(line, nullptr, false);
    if (parsed.is_object() && parsed.contains("step") && parsed["step"].is_number() &&
        parsed["step"].get<int64_t>() <= step) {
      remaining += line + "\n";
    }
  }
  writeFileAtomically(metricsPath(), remaining);
}

BlockGrid readGrid(const fs::path& file, const Capture& capture) {
  constexpr const char* kRemedy = "name the blocks.json of a model that was trained in blocks";
  const json parsed = json::parse(readTextFile(file), nullptr, false);
  if (!parsed.is_object() || !parsed.contains("grid"))
    throw Error(file.string(), "grid", "the file holds no grid of blocks", kRemedy);
  const std::optional<BlockGrid> grid = blockGridFromJson(parsed["grid"]);
  if (!grid) throw Error(file.string(), "grid", "is not a grid of blocks", kRemedy);
  if (!parsed.contains("source_from_world")) return *grid;
  try {
    if (isSameWorld(capture.sourceFromWorld, sourceFromWorldIn(parsed))) return *grid;
  } catch (const json::exception& error) {
    throw Error(file.string(), "source_from_world", error.what(), kRemedy);
  }
  throw Error(file.string(), "source_from_world",
              "its world is not the one of the capture " + capture.root.string() + ": the blocks would lie elsewhere",
              "import both captures from the same source, or let the capture be cut by --blocks");
}

void requireSameWorld(const ModelFolder& model, const Capture& capture) {
  const ModelPlacement placement = model.readPlacement();
  if (isSameWorld(capture.sourceFromWorld, placement.sourceFromWorld)) return;
  throw Error(capture.root.string(), "transforms.json",
              fmt::format("its world is not the one of {}, which was trained on {}", model.root().string(),
                          placement.capture.string()),
              "use that capture, or train on this one");
}

void requireTrainedOn(const ModelFolder& model, const Capture& capture) {
  requireSameWorld(model, capture);
  const std::vector<std::string> before = model.readPlacement().trainedOn, now = trainingNames(capture);
  if (now == before) return;
  const auto [was, is] = std::mismatch(before.begin(), before.end(), now.begin(), now.end());
  throw Error(capture.root.string(), "transforms.json",
              fmt::format("{} was trained on other photos: {} of them, not {}; '{}' is the first that differs",
                          model.root().string(), before.size(), now.size(), was != before.end() ? *was : *is),
              "resume with the same capture, or train into another folder");
}

std::vector<std::string> trainedOnAmong(const ModelFolder& model, const Capture& capture, Split split) {
  const std::vector<std::string> names = model.readPlacement().trainedOn;
  const std::unordered_set<std::string> trainedOn(names.begin(), names.end());
  std::vector<std::string> matches;
  for (const int photo : capture.photosIn(split)) {
    if (trainedOn.contains(capture.photos[photo].name)) matches.push_back(capture.photos[photo].name);
  }
  return matches;
}

std::vector<std::string> trainingNames(const Capture& capture) {
  std::vector<std::string> names;
  for (const int photo : capture.photosIn(Split::train)) names.push_back(capture.photos[photo].name);
  return names;
}

}  // namespace tessera
