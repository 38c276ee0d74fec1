#include "representations/field/field_model.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

// Samples of a ray that a round makes: few at first, for most rays end early.
constexpr uint32_t kMostOfRound[RaySamples::kRounds] = {8, 8, 16, 32, 64, 128, 256, 0xffffffffu};

}  // namespace

RaySamples::RaySamples(Device& device, uint32_t rays, uint32_t samples)
    : firstSample(device.array<uint32_t>(rays + 1)),
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

void FieldModel::sample(const Rays& rays, float minTransmittance, RaySamples& seen) {
  const uint32_t capacity = static_cast<uint32_t>(seen.distances.size());
  reserve(static_cast<uint32_t>(seen.firstSample.size()) - 1, capacity);
  CHECK(rays.count < seen.firstSample.size());
  const float mostOpticalDepth = -std::log(minTransmittance);
  const uint32_t firstsOfRound = rays.count + 1;
  device_.fillZero(nextStep_.part(0, rays.count));
  device_.fillZero(opticalDepth_.part(0, rays.count));
  for (uint32_t round = 0; round < RaySamples::kRounds; ++round) {
    const auto ofRound = [&](Array<float>& array, uint32_t columns) {
      return array.part(size_t{round} * capacity * columns, size_t{capacity} * columns);
    };
    MarchRays march{space_};
    march.rays = {rays.count, {}};
    march.sampleCapacity = capacity;
    march.most = kMostOfRound[round];
    march.mostOpticalDepth = mostOpticalDepth;
    march.origins = rays.origins;
    march.directions = rays.directions;
    march.jitter = rays.jitter;
    march.farOfRay = rays.far;
    march.occupancy = occupancy_.bits();
    march.opticalDepth = opticalDepth_;
    march.nextStep = nextStep_;
    march.firstSample = roundFirst_.part(size_t{round} * firstsOfRound, firstsOfRound);
    march.sampleCount = seen.counters.part(2 + round, 1);
    march.positions = ofRound(positions_, 3);
    march.distances = ofRound(distances_, 1);
    march.steps = ofRound(steps_, 1);
    device_.run(march);
    const Count made{capacity, march.sampleCount};
    const Matrix<float> logDensities(ofRound(logDensities_, 1), 1);
    field_.logDensity(made, march.positions, logDensities);
    device_.run(OpticalDepth{march.rays, march.firstSample, logDensities, march.steps, opticalDepth_});
  }

  CompactSamples compact;
  compact.rays = {rays.count, {}};
  compact.rounds = RaySamples::kRounds;
  compact.sampleCapacity = compact.keptCapacity = capacity;
  compact.mostOpticalDepth = mostOpticalDepth;
  compact.firstSample = roundFirst_;
  compact.nextStep = nextStep_;
  compact.logDensity = Matrix<float>(logDensities_, 1);
  compact.steps = steps_;
  compact.keptFirstSample = seen.firstSample;
  compact.keptCount = seen.counters.part(0, 1);
  compact.finishedRays = seen.counters.part(1, 1);
  compact.source = source_;
  compact.rayOfSample = seen.rayOfSample;
  device_.run(compact);

  const auto gather = [&](Array<float>& from, Array<float>& to, uint32_t columns) {
    device_.run(GatherRows{seen.samples(), source_, Matrix<float>(from, columns), Matrix<float>(to, columns)});
  };
  gather(positions_, seen.positions, 3);
  gather(distances_, seen.distances, 1);
  gather(steps_, seen.steps, 1);
}

void FieldModel::reserve(uint32_t rays, uint32_t samples) {
  field_.reserve(samples);
  if (nextStep_.size() < rays || !roundFirst_.size()) {
    nextStep_ = device_.array<uint32_t>(rays);
    opticalDepth_ = device_.array<float>(rays);
    roundFirst_ = device_.array<uint32_t>(size_t{RaySamples::kRounds} * (rays + 1));
  }
  if (source_.size() < samples) {
    const size_t all = size_t{RaySamples::kRounds} * samples;
    source_ = device_.array<uint32_t>(samples);
    positions_ = device_.array<float>(all * 3);
    for (Array<float>* perSample : {&distances_, &steps_, &logDensities_}) *perSample = device_.array<float>(all);
  }
}

void FieldModel::refreshOccupancy(uint32_t uniform, uint32_t occupied, uint64_t seed) {
  // As many at a time as there is room for anyway.
  const uint32_t chunk = std::clamp<uint32_t>(field_.capacity(), 1 << 12, 1 << 16);
  field_.reserve(chunk);
  occupancy_.update([&](Count count, Slice<const float> positions,
                        Matrix<float> logDensities) { field_.logDensity(count, positions, logDensities); },
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
                "the file belongs to another config.toml");
  }
  occupancy_.restore(values, bits);
}

std::unique_ptr<FieldModel> loadFieldModel(Device& device, const fs::path& folder) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "field");
  FieldConfig config;
  configFromToml(config.fields(), model.configPath());
  auto made = std::make_unique<FieldModel>(device, config, model.readPlacement().frame);
  const fs::path file = folder / manifest.files.at(0);
  made->restore(file, readSafetensors(file));
  return made;
}

}  // namespace tessera
