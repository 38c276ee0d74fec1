#include "representations/field/train/field_model.h"

#include <algorithm>

#include "base/error.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

const std::vector<uint32_t> kMaxOfRound{8, 8, 16, 32, 64, 128, 256, 0xffffffffu};

}  // namespace

RaySamples::RaySamples(Device& device, uint32_t rays, uint32_t samples)
    : firstSample(device.array<uint32_t>(rays + 1)),
      rayOfSample(device.array<uint32_t>(samples)),
      positions(device.array<float>(size_t{samples} * 3)),
      distances(device.array<float>(samples)),
      steps(device.array<float>(samples)) {}

FieldModel::FieldModel(Device& device, const FieldConfig& config, const SceneFrame& frame)
    : device_(device),
      config_(config),
      frame_(frame),
      space_(config.space()),
      field_(device, config.shape(), static_cast<uint64_t>(config.seed)),
      occupancy_(device, space_),
      rounds_(device, kMaxOfRound) {
  CHECK(rounds_.count() == RaySamples::kRounds);
}

void FieldModel::sample(const Rays& rays, float minTransmittance, RaySamples& seen) {
  march(rays, occupancy_.bits(), minTransmittance, 1, seen);
}

RadianceField::Output FieldModel::render(const Rays& rays, Slice<const uint32_t> cells, float minTransmittance,
                                         RaySamples& seen) {
  march(rays, cells, minTransmittance, RadianceField::kGeometryFeatures, seen);
  rounds_.gatherFeatures(field_.geometry());
  return field_.colour(seen.samples(), rays.directions, seen.rayOfSample);
}

void FieldModel::march(const Rays& rays, Slice<const uint32_t> cells, float minTransmittance, uint32_t features,
                       RaySamples& seen) {
  const uint32_t capacity = static_cast<uint32_t>(seen.distances.size());
  reserve(static_cast<uint32_t>(seen.firstSample.size()) - 1, capacity, features);
  CHECK(rays.count < seen.firstSample.size());
  MarchRays march{space_};
  march.origins = rays.origins;
  march.directions = rays.directions;
  march.jitter = rays.jitter;
  march.farOfRay = rays.far;
  march.occupancy = cells;
  rounds_.begin(rays.count, capacity, minTransmittance, seen.counters);
  for (uint32_t round = 0; round < RaySamples::kRounds; ++round) {
    rounds_.prepare(march, round);
    march.positions = rounds_.part(positions_, 3, round);
    march.distances = rounds_.part(distances_, 1, round);
    device_.run(march);
    field_.density(rounds_.marched(round), march.positions, rounds_.features(round));
    rounds_.addOpticalDepths(round);
  }
  rounds_.compactVisible(seen.firstSample, seen.rayOfSample);
  rounds_.gather(positions_, seen.positions, 3);
  rounds_.gather(distances_, seen.distances, 1);
  rounds_.gatherSteps(seen.steps);
}

void FieldModel::reserve(uint32_t rays, uint32_t samples, uint32_t features) {
  const size_t all = size_t{rounds_.count()} * samples;
  field_.reserve(samples);
  rounds_.reserve(rays, samples, features);
  if (distances_.size() < all) {
    positions_ = device_.array<float>(all * 3);
    distances_ = device_.array<float>(all);
  }
}

void FieldModel::refreshOccupancy(uint32_t uniform, uint32_t occupied, uint64_t seed) {
  // Evaluate as many points in one batch as memory is already allocated for.
  const uint32_t chunk = std::clamp<uint32_t>(field_.capacity(), 1 << 12, 1 << 16);
  field_.reserve(chunk);
  occupancy_.update([&](Count count, Slice<const float> positions,
                        Matrix<float> logDensities) { field_.density(count, positions, logDensities); },
                    uniform, occupied, seed, chunk);
}

bool FieldModel::allFinite() {
  return field_.table().allFinite(device_) && field_.densityNetwork().allFinite(device_) &&
         field_.colourNetwork().allFinite(device_);
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
                "restore the config.toml that the checkpoint was trained with, or train again");
  }
  occupancy_.restore(values, bits);
}

std::unique_ptr<FieldModel> loadFieldModel(Device& device, const fs::path& folder) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "field");
  FieldConfig config;
  configFromToml(config.fields(), model.configPath());
  auto loaded = std::make_unique<FieldModel>(device, config, model.readPlacement().frame);
  const fs::path file = folder / manifest.files.at(0);
  loaded->restore(file, readSafetensors(file));
  return loaded;
}

}  // namespace tessera
