#include "representations/mesh/train/mesh_model.h"

#include <algorithm>

#include "base/error.h"
#include "compute/occupancy.h"
#include "train/run_folder.h"

namespace tessera {

MeshHits::MeshHits(Device& device, uint32_t rays, uint32_t samples)
    : firstSample(device.array<uint32_t>(rays + size_t{1})),
      rayOfSample(device.array<uint32_t>(samples)),
      faces(device.array<uint32_t>(samples)),
      barycentrics(device.array<float>(size_t{2} * samples)),
      positions(device.array<float>(size_t{3} * samples)),
      distances(device.array<float>(samples)) {}

MeshModel::MeshModel(Device& device, const MeshConfig& config, const SceneFrame& frame)
    : device_(device),
      config_(config),
      frame_(frame),
      grid_(config.grid()),
      field_(device, config.shape(), static_cast<uint64_t>(config.seed)),
      displacements_(device, "displacements", std::vector<float>(size_t{3} * grid_.cells())),
      occupancy_(device, config.space()),
      tracedCells_(device.array<uint32_t>(grid_.words())) {
  updateTracedCells();
}

void MeshModel::trace(const Rays& rays, uint32_t maximum, MeshHits& hits) {
  CHECK(rays.count < hits.firstSample.size());
  TraceOctahedra trace{grid_};
  trace.rays = {rays.count};
  trace.sampleCapacity = static_cast<uint32_t>(hits.distances.size());
  trace.maximum = maximum;
  trace.near = static_cast<float>(config_.near);
  trace.origins = rays.origins;
  trace.directions = rays.directions;
  trace.farOfRay = rays.far;
  trace.displacements = displacements_.values;
  trace.occupancy = tracedCells_;
  if (keptFaces_.size() > 0) trace.keptFaces = keptFaces_;
  trace.firstSample = hits.firstSample;
  trace.sampleCount = hits.counters.part(0, 1);
  trace.finishedRays = hits.counters.part(1, 1);
  trace.rayOfSample = hits.rayOfSample;
  trace.faces = hits.faces;
  trace.barycentrics = hits.barycentrics;
  trace.positions = hits.positions;
  trace.distances = hits.distances;
  device_.run(trace);
}

void MeshModel::keepFaces(const std::vector<uint32_t>& bits) {
  CHECK((bits.empty() || bits.size() == grid_.faceWords()));
  keptFaces_ = device_.uploadArray(bits);
}

void MeshModel::backward(const Rays& rays, const MeshHits& hits, Slice<const float> positionGradients) {
  OctahedraBackward back{grid_};
  back.samples = hits.samples();
  back.minCosine = static_cast<float>(config_.minCosine);
  back.origins = rays.origins;
  back.directions = rays.directions;
  back.displacements = displacements_.values;
  back.rayOfSample = hits.rayOfSample;
  back.faces = hits.faces;
  back.barycentrics = hits.barycentrics;
  back.distances = hits.distances;
  back.positionGradients = positionGradients;
  back.displacementGradients = displacements_.gradients;
  device_.run(back);
}

void MeshModel::exclude(const std::vector<bool>& possible) {
  occupancy_.exclude(possible);
  occupancy_.fill(1);
  updateTracedCells();
}

void MeshModel::addOccupancy(const Rays& rays, const MeshHits& hits, Matrix<const float> logits) {
  OccupancySamples samples;
  samples.resolution = grid_.resolution;
  samples.offset = opacityOffset();
  samples.rays = hits.finished(rays.count);
  samples.firstSample = hits.firstSample;
  samples.x = logits;
  samples.positions = hits.positions;
  samples.grid = occupancy_.raisedBySamples();
  device_.run(samples);
}

void MeshModel::refreshOccupancy() {
  constexpr float kThreshold = 0.05f;
  occupancy_.update(static_cast<float>(config_.occupancyDecay), kThreshold);
  updateTracedCells();
}

void MeshModel::updateTracedCells() {
  device_.write(tracedCells_.all(), std::span<const uint32_t>(dilateCells(occupancy_.bitWords(), grid_.resolution)));
}

bool MeshModel::allFinite() {
  return field_.table().allFinite(device_) && field_.encoder().allFinite(device_) &&
         field_.decoder().allFinite(device_) && displacements_.allFinite(device_);
}

void MeshModel::save(TensorSet& tensors, bool withMoments) {
  for (const ParameterGroup* group : {&field_.table(), &field_.encoder(), &field_.decoder(), &displacements_}) {
    tensors.add(device_, *group, withMoments);
  }
  tensors.add("occupancy.values", occupancy_.values());
  tensors.add("occupancy.bits", occupancy_.bitWords());
}

void MeshModel::restore(const fs::path& path, const Safetensors& file) {
  for (ParameterGroup* group : {&field_.table(), &field_.encoder(), &field_.decoder(), &displacements_}) {
    loadGroup(device_, path, file, *group);
  }
  const auto values = file.require(path, "occupancy.values", TensorType::f32).as<float>();
  const auto bits = file.require(path, "occupancy.bits", TensorType::u32).as<uint32_t>();
  if (values.size() != occupancy_.cells() || bits.size() != occupancy_.cells() / 32) {
    throw Error(path.string(), "tensor occupancy.values", "has another resolution than the settings",
                "restore the config.toml that the checkpoint was trained with, or train again");
  }
  occupancy_.restore(values, bits);
  updateTracedCells();
}

std::vector<uint32_t> dilateCells(std::span<const uint32_t> bits, uint32_t cells) {
  const size_t n = cells, all = n * n * n;
  std::vector<uint8_t> marked(all);
  for (size_t i = 0; i < all; ++i) marked[i] = bits[i / 32] >> i % 32 & 1;
  size_t stride = 1;
  for (int axis = 0; axis < 3; ++axis, stride *= n) {
    const std::vector<uint8_t> before = marked;
    for (size_t i = 0; i < all; ++i) {
      const size_t place = i / stride % n;
      if (place > 0) marked[i] |= before[i - stride];
      if (place + 1 < n) marked[i] |= before[i + stride];
    }
  }
  std::vector<uint32_t> dilated(bits.size());
  for (size_t i = 0; i < all; ++i) dilated[i / 32] |= uint32_t{marked[i]} << i % 32;
  return dilated;
}

std::unique_ptr<MeshModel> loadMeshModel(Device& device, const fs::path& folder) {
  const ModelFolder model(folder);
  const ModelManifest manifest = requireManifest(model, "mesh");
  MeshConfig config;
  configFromToml(config.fields(), model.configPath());
  auto loaded = std::make_unique<MeshModel>(device, config, model.readPlacement().frame);
  const fs::path file = folder / manifest.files.at(0);
  loaded->restore(file, readSafetensors(file));
  return loaded;
}

}  // namespace tessera
