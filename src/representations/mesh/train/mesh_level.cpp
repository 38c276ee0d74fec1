#include "representations/mesh/train/mesh_level.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "compute/occupancy.h"

namespace tessera {
namespace {

// The space of an occupancy whose values are opacities.
MarchSpace occupancySpace(const OctahedraDomain& domain) {
  MarchSpace space;
  space.contracted = false;
  space.gridResolution = static_cast<int>(domain.latticeCells());
  return space;
}

}  // namespace

MeshHits::MeshHits(Device& device, uint32_t rays, uint32_t samples)
    : firstSample(device.array<uint32_t>(rays + size_t{1})),
      rayOfSample(device.array<uint32_t>(samples)),
      faces(device.array<uint32_t>(samples)),
      barycentrics(device.array<float>(size_t{2} * samples)),
      positions(device.array<float>(size_t{3} * samples)),
      distances(device.array<float>(samples)) {}

MeshLevel::MeshLevel(Device& device, uint32_t number, OctahedraDomain domain, const Settings& settings,
                     const std::vector<float>& displacements)
    : device_(device),
      prefix_(tensorPrefix(number)),
      domain_(std::move(domain)),
      settings_(settings),
      displacements_(device, prefix_ + "displacements", displacements, settings.forTraining),
      occupancy_(device, occupancySpace(domain_)),
      tracedCells_(device.array<uint32_t>(domain_.grids.size() * domain_.grids[0].words())) {
  CHECK(displacements.size() == size_t{3} * domain_.grids[0].cells() * domain_.grids.size());
  occupancy_.fill(1);  // so that a cell becomes empty only when no ray has reached it for many updates
  keepFaces({});
  updateTracedCells();
}

std::string MeshLevel::tensorPrefix(uint32_t number) {
  return fmt::format("level{}.", number);
}

void MeshLevel::trace(const MeshRays& rays, uint32_t maximum, bool inOwn, MeshHits& hits) {
  CHECK(rays.count < hits.firstSample.size());
  TraceOctahedra trace{inOwn ? domain_.ownGrids : domain_.grids};
  trace.boxInFront = domain_.boxInFront;
  trace.rays = {rays.count};
  trace.sampleCapacity = static_cast<uint32_t>(hits.distances.size());
  trace.maximum = maximum;
  trace.near = settings_.near;
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

void MeshLevel::keepFaces(const std::vector<uint32_t>& bits) {
  CHECK((bits.empty() || bits.size() == faceWords(domain_.grids)));
  keptFaces_ = device_.uploadArray(bits.empty() && settings_.quads ? FaceSet::quads(domain_.grids).bits() : bits);
}

void MeshLevel::limitToFaces(const FaceSet& faces) {
  keepFaces(faces.bits());
  isLimited_ = true;
  // A triangle lies in the smallest box of cells that contains its vertices.
  const uint32_t n = domain_.grids[0].resolution, cells = domain_.grids[0].cells(), words = domain_.grids[0].words();
  std::vector<uint32_t> traced(words * domain_.grids.size());
  for (const uint32_t face : faces.numbers()) {
    const uint32_t grid = face / kFacesPerCell / cells, cell = face / kFacesPerCell % cells;
    const int place[3] = {static_cast<int>(cell % n), static_cast<int>(cell / n % n), static_cast<int>(cell / (n * n))};
    int low[3] = {place[0] + 1, place[1] + 1, place[2] + 1}, high[3] = {place[0] - 1, place[1] - 1, place[2] - 1};
    for (const auto& corner : octahedronFace(face % kFacesPerCell)) {
      for (int axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], place[axis] + corner[axis]);
        high[axis] = std::max(high[axis], place[axis] + corner[axis]);
      }
    }
    for (int k = low[2]; k <= high[2]; ++k)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int i = low[0]; i <= high[0]; ++i) {
          const uint32_t at = static_cast<uint32_t>(i) + n * (static_cast<uint32_t>(j) + n * static_cast<uint32_t>(k));
          traced[words * grid + at / 32] |= 1u << at % 32;
        }
  }
  device_.write(tracedCells_.all(), std::span<const uint32_t>(traced));
}

void MeshLevel::removeLimit() {
  isLimited_ = false;
  keepFaces({});
  updateTracedCells();
}

void MeshLevel::backward(const MeshRays& rays, const MeshHits& hits, Slice<const float> positionGradients) {
  OctahedraBackward back{domain_.grids};
  back.samples = hits.samples();
  back.minCosine = settings_.minCosine;
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

void MeshLevel::exclude(const std::vector<bool>& possible) {
  occupancy_.exclude(possible);
  occupancy_.fill(1);
  updateTracedCells();
}

void MeshLevel::addOccupancy(const MeshRays& rays, const MeshHits& hits, Matrix<const float> logits) {
  OccupancySamples samples;
  samples.resolution = domain_.latticeCells();
  samples.offset = settings_.opacityOffset;
  samples.rays = hits.finished(rays.count);
  samples.firstSample = hits.firstSample;
  samples.x = logits;
  samples.positions = hits.positions;
  samples.grid = occupancy_.raisedBySamples();
  device_.run(samples);
}

void MeshLevel::refreshOccupancy(bool tracesNeighbours) {
  constexpr float kThreshold = 0.05f;
  tracesNeighbours_ = tracesNeighbours;
  const std::vector<uint32_t> before = occupancy_.bitWords();
  occupancy_.update(settings_.occupancyDecay, kThreshold);
  const std::vector<uint32_t> after = occupancy_.bitWords();
  // While everything is equally transparent, no cell is above the mean. Without cells, there would be no more hits.
  if (std::all_of(after.begin(), after.end(), [](uint32_t word) { return word == 0; }))
    occupancy_.restore(occupancy_.values(), before);
  updateTracedCells();
}

void MeshLevel::updateTracedCells() {
  if (isLimited_) return;
  std::vector<uint32_t> cells = occupancy_.bitWords();
  if (tracesNeighbours_) cells = dilateCells(cells, domain_.latticeCells());
  device_.write(tracedCells_.all(), std::span<const uint32_t>(domain_.toGrids(cells)));
}

void MeshLevel::save(TensorSet& tensors, bool withMoments) {
  tensors.add(device_, displacements_, withMoments);
  tensors.add(prefix_ + "occupancy.values", occupancy_.values());
  tensors.add(prefix_ + "occupancy.bits", occupancy_.bitWords());
  tensors.add(prefix_ + "occupancy.traces_neighbours", std::vector<uint32_t>{tracesNeighbours_});
}

void MeshLevel::restore(const fs::path& path, const Safetensors& file) {
  loadGroup(device_, path, file, displacements_);
  for (const float displacement : device_.read(displacements_.values.all())) {
    if (!(std::abs(displacement) < 0.5f)) {
      throw Error(path.string(), "tensor " + displacements_.name, "has a vertex outside of its cell",
                  "restore the file, or train again");
    }
  }
  const auto values = file.require(path, prefix_ + "occupancy.values", TensorType::f32).as<float>();
  const auto bits = file.require(path, prefix_ + "occupancy.bits", TensorType::u32).as<uint32_t>();
  if (values.size() != occupancy_.cells() || bits.size() != occupancy_.cells() / 32) {
    throw Error(path.string(), "tensor " + prefix_ + "occupancy.values", "has another resolution than the settings",
                "restore the config.toml that the checkpoint was trained with, or train again");
  }
  occupancy_.restore(values, bits);
  const auto neighbours = file.require(path, prefix_ + "occupancy.traces_neighbours", TensorType::u32).as<uint32_t>();
  if (neighbours.size() != 1) {
    throw Error(path.string(), "tensor " + prefix_ + "occupancy.traces_neighbours", "is not one number",
                "restore the file, or train again");
  }
  tracesNeighbours_ = neighbours[0] != 0;
  updateTracedCells();
}

}  // namespace tessera
