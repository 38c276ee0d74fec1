#include "representations/field/field_model.h"

#include "base/error.h"
#include "train/model_folder.h"

namespace tessera {
namespace {

// Samples of a ray that are looked up before asking whether it is opaque: few at first, for most rays end early.
constexpr uint32_t kStages[] = {16, 16, 32, 32, 64, 64, 128, 1u << 30};

}  // namespace

RaySamples::RaySamples(Device& device, uint32_t rays, uint32_t samples)
    : firstSample(device.array<uint32_t>(rays + 1)),
      count(device.array<uint32_t>(1)),
      finishedRays(device.array<uint32_t>(1)),
      rayOfSample(device.array<uint32_t>(samples)),
      positions(device.array<float>(size_t{samples} * 3)),
      distances(device.array<float>(samples)),
      steps(device.array<float>(samples)) {}

namespace {

Device& able(Device& device) {
  requireAllOperations(device);
  return device;
}

}  // namespace

FieldModel::FieldModel(Device& device, const FieldConfig& config, const SceneFrame& frame)
    : device_(able(device)),
      config_(config),
      frame_(frame),
      space_(config.space()),
      field_(device, config.shape(), static_cast<uint64_t>(config.seed)),
      occupancy_(device, space_) {}

void FieldModel::sample(const Rays& rays, float minTransmittance, RaySamples& marched, RaySamples& kept) {
  const uint32_t capacity = static_cast<uint32_t>(marched.distances.size());
  const uint32_t keptCapacity = static_cast<uint32_t>(kept.distances.size());
  reserve(rays.count, capacity, keptCapacity);
  MarchRays march{space_};
  march.rays = {rays.count, {}};
  march.sampleCapacity = capacity;
  march.origins = rays.origins;
  march.directions = rays.directions;
  march.jitter = rays.jitter;
  march.farOfRay = rays.far;
  march.occupancy = occupancy_.bits();
  march.firstSample = marched.firstSample;
  march.sampleCount = marched.count;
  march.finishedRays = marched.finishedRays;
  march.rayOfSample = marched.rayOfSample;
  march.positions = marched.positions;
  march.distances = marched.distances;
  march.steps = marched.steps;
  device_.run(march);

  const Count finished{rays.count, marched.finishedRays};
  const Matrix<float> logDensities(logDensities_.all(), 1);
  device_.fillZero(lookedAt_.all());
  SelectSamples select;
  select.rays = finished;
  select.sampleCapacity = capacity;
  select.selectedCapacity = keptCapacity;
  select.minTransmittance = minTransmittance;
  select.firstSample = marched.firstSample;
  select.logDensity = logDensities;
  select.steps = marched.steps;
  select.lookedAt = lookedAt_;
  select.selected = selected_;
  select.selectedCount = selectedCount_;
  for (const uint32_t most : kStages) {
    select.most = most;
    device_.run(select);
    const Count rows{keptCapacity, selectedCount_};
    device_.run(GatherRows{rows, selected_, Matrix<const float>(marched.positions.all(), 3),
                           Matrix<float>(selectedPositions_.all(), 3)});
    device_.run(ScatterRows{rows, selected_, field_.logDensity(rows, selectedPositions_), logDensities});
  }

  CompactSamples compact;
  compact.rays = finished;
  compact.sampleCapacity = capacity;
  compact.keptCapacity = keptCapacity;
  compact.minTransmittance = minTransmittance;
  compact.firstSample = marched.firstSample;
  compact.lookedAt = lookedAt_;
  compact.logDensity = logDensities;
  compact.steps = marched.steps;
  compact.keptFirstSample = kept.firstSample;
  compact.keptCount = kept.count;
  compact.finishedRays = kept.finishedRays;
  compact.source = source_;
  device_.run(compact);

  const Count rows{keptCapacity, kept.count};
  const auto gather = [&](Slice<const float> from, Slice<float> to, uint32_t columns) {
    device_.run(GatherRows{rows, source_, Matrix<const float>(from, columns), Matrix<float>(to, columns)});
  };
  gather(marched.positions, kept.positions, 3);
  gather(marched.distances, kept.distances, 1);
  gather(marched.steps, kept.steps, 1);
  gather(asFloats(marched.rayOfSample.all()), asFloats(kept.rayOfSample.all()), 1);
}

void FieldModel::reserve(uint32_t rays, uint32_t marched, uint32_t kept) {
  field_.reserve(kept);
  if (lookedAt_.size() < rays) lookedAt_ = device_.array<uint32_t>(rays);
  if (logDensities_.size() < marched) logDensities_ = device_.array<float>(marched);
  if (source_.size() < kept) {
    source_ = device_.array<uint32_t>(kept);
    selected_ = device_.array<uint32_t>(kept);
    selectedCount_ = device_.array<uint32_t>(1);
    selectedPositions_ = device_.array<float>(size_t{kept} * 3);
  }
}

void FieldModel::refreshOccupancy(uint32_t uniform, uint32_t occupied, uint64_t seed) {
  constexpr uint32_t kChunk = 1 << 16;
  field_.reserve(kChunk);
  occupancy_.update([&](Count count, Slice<const float> positions) { return field_.logDensity(count, positions); },
                    uniform, occupied, seed, kChunk);
}

void FieldModel::save(TensorSet& tensors, bool withMoments) {
  for (const ParameterGroup* group : {&field_.table(), &field_.densityNetwork(), &field_.colourNetwork()}) {
    tensors.add(device_, *group, withMoments);
  }
  tensors.add("occupancy.values", occupancy_.values());
  tensors.add("occupancy.bits", occupancy_.bitWords());
}

void FieldModel::restore(const fs::path& path, const Safetensors& file) {
  for (ParameterGroup* group : {&field_.table(), &field_.densityNetwork(), &field_.colourNetwork()}) {
    loadGroup(device_, path, file, *group);
  }
  const auto values = file.require(path, "occupancy.values", TensorType::f32).as<float>();
  const auto bits = file.require(path, "occupancy.bits", TensorType::u32).as<uint32_t>();
  if (values.size() != occupancy_.cells() || bits.size() != occupancy_.cells() / 32) {
    throw Error(path.string(), "tensor occupancy.values", "has another resolution than the settings",
                "the file belongs to another config.toml");
  }
  occupancy_.restore(values, bits);
}

std::unique_ptr<FieldModel> loadFieldModel(Device& device, const fs::path& folder) {
  const ModelFolder model(folder);
  const std::optional<ModelManifest> manifest = model.manifest();
  if (!manifest) {
    throw Error(folder.string(), "manifest.json", "there is none: this is no trained model",
                "train one with: tessera train CAPTURE " + folder.string() + " --method field");
  }
  FieldConfig config;
  configFromToml(config.fields(), model.configPath());
  auto made = std::make_unique<FieldModel>(device, config, model.readPlacement().frame);
  const fs::path file = folder / manifest->files.at(0);
  made->restore(file, readSafetensors(file));
  return made;
}

}  // namespace tessera
