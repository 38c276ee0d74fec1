#include "representations/hash/train/hash_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <type_traits>

#include "base/error.h"
#include "base/random.h"
#include "compute/rows.h"
#include "field/initial_values.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

const std::vector<uint32_t> kMaxOfRound{8, 16, 32, 64, 128, 0xffffffffu};

constexpr uint32_t kMinChunk = 1 << 12;  // points at which occupancy is evaluated in one batch

Device& afterCheck(Device& device, const HashConfig& config) {
  config.check();
  return device;
}

// Reinterprets words as floats, for operations that only copy them.
template <class Word>
auto asFloats(const Slice<Word>& words) {
  using Float = std::conditional_t<std::is_const_v<Word>, const float, float>;
  return Slice<Float>(words.memory, words.first, words.count);
}

}  // namespace

HashSamples::HashSamples(Device& device, uint32_t rays, uint32_t samples)
    : firstSample(device.array<uint32_t>(rays + size_t{1})),
      rayOfSample(device.array<uint32_t>(samples)),
      slotOfSample(device.array<uint32_t>(samples)),
      positions(device.array<float>(size_t{samples} * 3)) {
  for (Array<float>* each : {&distances, &steps, &middles, &widths}) *each = device.array<float>(samples);
}

HashModel::HashModel(Device& device, const HashConfig& config, const BlockGrid& grid, bool forTraining)
    : device_(afterCheck(device, config)),
      config_(config),
      grid_(grid),
      frame_(makeSceneFrame(grid)),
      space_(makeBlockSpace(grid, config.near, config.backgroundBlockMode())),
      fields_(device, config, space_.blocks(), forTraining),
      direction_(device, "direction.network",
                 initialWeights(config.directionShape(), mix64(static_cast<uint64_t>(config.seed) + 2), 0xd1),
                 forTraining),
      seen_(space_.blocks(), true),
      rounds_(device, kMaxOfRound) {
  CHECK(rounds_.count() == HashSamples::kRounds);
  // The longest path, in widths of a domain: the diagonal of the box, and a contracted block from end to end.
  const double widths = std::hypot(space_.columns, space_.rows, 1) + 4;
  const double steps = widths / (config.longestStep() * config.minRayStepRatio);
  if (!(steps <= kMaxSteps)) {
    throw Error(fmt::format("--set max_ray_step={} min_ray_step_ratio={} lattice={}", config.maxRayStep,
                            config.minRayStepRatio, config.lattice),
                "", fmt::format("a ray could take {:.0f} steps", steps),
                fmt::format("use longer steps: at most {} per ray", kMaxSteps));
  }
  const size_t cells = static_cast<size_t>(config.occupancyResolution), words = cells * cells * cells / 32;
  occupied_ = device.array<uint32_t>(words * space_.blocks());
  for (uint32_t block = 0; block < space_.blocks(); ++block) {
    occupancy_.emplace_back(device, occupancySpace(block), occupied_.part(block * words, words));
  }
}

MarchSpace HashModel::occupancySpace(uint32_t block) const {
  const BlockSpace::Placement placement = space_.placement(block);
  MarchSpace space;
  space.contracted = placement.contracted;
  space.gridResolution = config_.occupancyResolution;
  space.near = space_.near;
  // Outside the cube, the length of a step in scene units grows in proportion to the distance.
  space.minStep = config_.longestStep() * 2 * placement.halfDomain() * placement.scale[0];
  space.cone = placement.contracted ? space.minStep : 0;
  return space;
}

void HashModel::reserve(uint32_t rays, uint32_t samples, uint32_t texels) {
  fields_.reserve(samples, std::max(texels, 8 * std::min(samples, kMinChunk)));
  if (!zero_.size()) zero_ = device_.array<uint32_t>(1);
  const size_t all = size_t{rounds_.count()} * samples;
  rounds_.reserve(rays, samples);
  if (distances_.size() < all) {
    for (Array<uint32_t>* words : {&slots_, &rays_}) *words = device_.array<uint32_t>(all);
    positions_ = device_.array<float>(all * 3);
    for (Array<float>* one : {&distances_, &middles_, &widths_}) *one = device_.array<float>(all);
  }
}

void HashModel::sample(const Rays& rays, float minTransmittance, HashSamples& seen) {
  const uint32_t capacity = static_cast<uint32_t>(seen.distances.size());
  CHECK(rays.count < seen.firstSample.size());
  MarchBlocks march{space_};
  march.cells = static_cast<uint32_t>(config_.occupancyResolution);
  march.step = static_cast<float>(stepScale_) * config_.longestStep();
  march.origins = rays.origins;
  march.directions = rays.directions;
  march.jitter = rays.jitter;
  march.nearOfRay = rays.near;
  march.farOfRay = rays.far;
  march.occupancy = occupied_;
  rounds_.begin(rays.count, capacity, minTransmittance, seen.counters.part(0, HashSamples::kFirstTexels));
  for (uint32_t round = 0; round < HashSamples::kRounds; ++round) {
    rounds_.prepare(march, round);
    march.rayOfSample = rounds_.part(rays_, 1, round);
    march.slotOfSample = rounds_.part(slots_, 1, round);
    march.positions = rounds_.part(positions_, 3, round);
    march.distances = rounds_.part(distances_, 1, round);
    march.middles = rounds_.part(middles_, 1, round);
    march.widths = rounds_.part(widths_, 1, round);
    device_.run(march);
    const Count marched = rounds_.marched(round);
    const Matrix<const float> features = fields_.forward({marched, march.slotOfSample, march.positions}, false);
    const Matrix<float> logDensities = rounds_.logDensities(round);
    device_.fillZero(logDensities.data);
    device_.run(AddColumns{marched, Matrix<const float>(features.data, 1, features.rowStride), logDensities});
    rounds_.addOpticalDepths(round);
    keepTexelCount(seen, round);
  }
  rounds_.compactVisible(seen.firstSample, seen.rayOfSample);
  rounds_.gather(asFloats(slots_.all()), asFloats(seen.slotOfSample.all()), 1);
  rounds_.gather(positions_, seen.positions, 3);
  rounds_.gather(distances_, seen.distances, 1);
  rounds_.gatherSteps(seen.steps);
  rounds_.gather(middles_, seen.middles, 1);
  rounds_.gather(widths_, seen.widths, 1);
}

Matrix<const float> HashModel::evaluateFeatures(HashSamples& seen, bool forBackward) {
  const Matrix<const float> features = fields_.forward(seen.places(), forBackward);
  keepTexelCount(seen, HashSamples::kRounds);
  return features;
}

void HashModel::keepTexelCount(HashSamples& seen, uint32_t lookUp) {
  const Slice<uint32_t> counter = seen.counters.part(HashSamples::kFirstTexels + lookUp, 1);
  device_.run(GatherRows{
      {1}, zero_, Matrix<const float>(asFloats(fields_.texelCounter()), 1), Matrix<float>(asFloats(counter), 1)});
}

void HashModel::adaptStep(double samplesPerRay) {
  const double change = config_.rayStepChange;
  stepScale_ = samplesPerRay >= config_.minSamplesPerRay ? std::min(1.0, (1 + change) * stepScale_)
                                                         : std::max(config_.minRayStepRatio, (1 - change) * stepScale_);
}

void HashModel::exclude(uint32_t block, const std::vector<bool>& visible) {
  if (std::find(visible.begin(), visible.end(), true) != visible.end()) {
    occupancy_[block].exclude(visible);
    return;
  }
  seen_[block] = false;
  const std::vector<float> values(visible.size(), -1);
  const std::vector<uint32_t> bits(visible.size() / 32);
  occupancy_[block].restore(values, bits);
}

void HashModel::refreshOccupancy(bool everything, uint64_t seed) {
  // A chunk has only as many points as all of their corners fit the capacity: corners beyond it would count as fog.
  const uint32_t chunk = std::min(rounds_.sampleCapacity(), fields_.texelCapacity() / 8);
  CHECK(chunk >= 1u);
  if (slotOfPoint_.size() < chunk) slotOfPoint_ = device_.array<uint32_t>(chunk);
  for (uint32_t block = 0; block < space_.blocks(); ++block) {
    if (!seen_[block]) continue;
    const uint32_t cells = occupancy_[block].visibleCells();
    const uint32_t share = static_cast<uint32_t>(std::ceil(cells * config_.occupancyUpdateFraction));
    const std::vector<uint32_t> slots(chunk, block);
    device_.write(slotOfPoint_.all(), std::span<const uint32_t>(slots));
    const auto logDensity = [&](Count count, Slice<const float> positions, Matrix<float> logDensities) {
      const Matrix<const float> features = fields_.forward({count, slotOfPoint_, positions}, false);
      device_.fillZero(logDensities.data);
      device_.run(AddColumns{count, Matrix<const float>(features.data, 1, features.rowStride), logDensities});
    };
    const uint64_t blockSeed = mix64(seed ^ (uint64_t{block} << 48));
    occupancy_[block].update(logDensity, everything ? cells : share, everything ? 0 : share, blockSeed, chunk);
  }
}

double HashModel::occupiedFraction() {
  double sum = 0;
  for (OccupancyGrid& occupancy : occupancy_) sum += occupancy.occupiedFraction();
  return sum / static_cast<double>(occupancy_.size());
}

std::vector<ParameterGroup*> HashModel::sharedGroups() {
  std::vector<ParameterGroup*> groups = fields_.sharedGroups();
  groups.push_back(&direction_);
  return groups;
}

void HashModel::save(uint32_t block, TensorSet& tensors, bool withMoments) {
  for (const ParameterGroup* group : fields_.slotParameterGroups(block)) tensors.add(device_, *group, withMoments);
  tensors.add("occupancy.values", occupancy_[block].values());
  tensors.add("occupancy.bits", occupancy_[block].bitWords());
  if (block != 0) return;
  for (const ParameterGroup* group : sharedGroups()) tensors.add(device_, *group, withMoments);
  tensors.add("step_scale", std::vector<double>{stepScale_});
}

void HashModel::restore(uint32_t block, const fs::path& path, const Safetensors& file) {
  for (ParameterGroup* group : fields_.slotParameterGroups(block)) loadGroup(device_, path, file, *group);
  const auto values = file.require(path, "occupancy.values", TensorType::f32).as<float>();
  const auto bits = file.require(path, "occupancy.bits", TensorType::u32).as<uint32_t>();
  OccupancyGrid& occupancy = occupancy_[block];
  if (values.size() != occupancy.cells() || bits.size() != occupancy.cells() / 32) {
    throw Error(path.string(), "tensor occupancy.values", "has another resolution than the settings",
                "restore the config.toml that the checkpoint was trained with, or train again");
  }
  occupancy.restore(values, bits);
  if (block != 0) return;
  for (ParameterGroup* group : sharedGroups()) loadGroup(device_, path, file, *group);
  const TensorView& scale = file.require(path, "step_scale", TensorType::f64);
  if (scale.elements() != 1 || !(scale.as<double>()[0] > 0) || scale.as<double>()[0] > 1) {
    throw Error(path.string(), "tensor step_scale", "is not one number above 0 and up to 1", "train again");
  }
  stepScale_ = scale.as<double>()[0];
}

bool HashModel::allFinite(uint32_t block) {
  for (const ParameterGroup* group : fields_.slotParameterGroups(block)) {
    if (!group->allFinite(device_)) return false;
  }
  if (block != 0) return true;
  const std::vector<ParameterGroup*> shared = sharedGroups();
  return std::all_of(shared.begin(), shared.end(), [&](ParameterGroup* group) { return group->allFinite(device_); });
}

std::unique_ptr<HashModel> loadHashModel(Device& device, const fs::path& folder) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "hash");
  HashConfig config;
  configFromToml(config.fields(), model.configPath());
  auto loaded = std::make_unique<HashModel>(device, config, requireGrid(model), false);
  requireOneFileABlock(folder, manifest, loaded->space().blocks());
  for (uint32_t block = 0; block < loaded->space().blocks(); ++block) {
    const fs::path file = folder / manifest.files[block];
    loaded->restore(block, file, readSafetensors(file));
  }
  return loaded;
}

}  // namespace tessera
