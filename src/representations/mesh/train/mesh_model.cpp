#include "representations/mesh/train/mesh_model.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/random.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/train/texel_atlas.h"

namespace tessera {
namespace {

constexpr uint32_t kPointsPerCell = 16;  // at which the opacities of cells are compared
constexpr uint32_t kPointsAtATime = 1 << 16;
constexpr const char* kPatchEdgeTensor = "atlas.patch_edge";
constexpr const char* kCoverageTensor = "atlas.coverage";  // pixels, holes

bool isSet(const std::vector<uint32_t>& bits, size_t i) {
  return (bits[i / 32] >> i % 32 & 1) != 0;
}

[[noreturn]] void throwOtherSettings(const fs::path& path, const std::string& prefix) {
  throw Error(path.string(), "tensors " + prefix + "*", "do not belong to these settings",
              "restore the config.toml that the checkpoint was trained with, or train again");
}

size_t countDisplacements(const OctahedraDomain& domain) {
  return size_t{3} * domain.grids[0].cells() * domain.grids.size();
}

// Adds the numbers of the faces, and the directions in which they are seen.
void saveFaces(TensorSet& tensors, const std::string& prefix, const FaceSet& faces) {
  const std::vector<uint32_t> numbers = faces.numbers();
  std::vector<float> directions;
  for (const uint32_t face : numbers) {
    const Vec3f direction = faces.direction(face);
    directions.insert(directions.end(), direction.begin(), direction.end());
  }
  tensors.add(prefix + "faces", numbers);
  tensors.add(prefix + "directions", directions);
}

FaceSet restoreFaces(const fs::path& path, const Safetensors& file, const std::string& prefix,
                     const OctahedraDomain& domain) {
  const auto numbers = file.require(path, prefix + "faces", TensorType::u32).as<uint32_t>();
  const auto directions = file.require(path, prefix + "directions", TensorType::f32).as<float>();
  const uint64_t all = uint64_t{kFacesPerCell} * domain.grids[0].cells() * domain.grids.size();
  if (directions.size() != 3 * numbers.size() || !std::all_of(numbers.begin(), numbers.end(), [&](uint32_t face) {
        return face < all && faceExists(domain.grids, face);
      }))
    throwOtherSettings(path, prefix);
  FaceSet faces(domain.grids);
  for (size_t i = 0; i < numbers.size(); ++i)
    faces.add(numbers[i], Vec3f(directions[3 * i], directions[3 * i + 1], directions[3 * i + 2]));
  return faces;
}

}  // namespace

std::optional<SurfaceCoverage> readCoverage(const MeshPart& part, const fs::path& path, const Safetensors& checkpoint) {
  if (!checkpoint.tensors.contains(kCoverageTensor)) return std::nullopt;
  const auto numbers = checkpoint.require(path, kCoverageTensor, TensorType::u32).as<uint32_t>();
  if (numbers.size() != 2 || numbers[0] == 0 || numbers[1] > numbers[0]) {
    throw Error(path.string(), kCoverageTensor, "is not a number of pixels and a part of it",
                "restore the checkpoint or train again");
  }
  return SurfaceCoverage{part.name, numbers[0], numbers[1]};
}

uint32_t countLevels(const MeshConfig& config, const MeshPart& part, const Safetensors& checkpoint) {
  const auto contains = [&](uint32_t level) {
    return checkpoint.tensors.contains(MeshLevel::tensorPrefix(level) + "displacements");
  };
  uint32_t levels = 1;
  while (levels < MeshModel::maxLevels(config, part) && contains(levels)) ++levels;
  return levels;
}

bool hasAtlas(const Safetensors& checkpoint) {
  return checkpoint.tensors.contains(kPatchEdgeTensor);
}

MeshModel::MeshModel(Device& device, const MeshConfig& config, const MeshPart& part, MeshUse use)
    : device_(device),
      config_(config),
      part_(part),
      use_(use),
      field_(device, config.shape(), static_cast<uint64_t>(config.seed), use == MeshUse::training) {
  constexpr float kGrey = 0.5f;
  if (part.isBackground()) {
    sky_ = ParameterGroup(device, "sky", std::vector<float>(size_t{3} * 6 * kSkyResolution * kSkyResolution, kGrey),
                          isForTraining());
  }
  levels_.push_back(makeLevel(0, std::vector<float>(countDisplacements(domain(0)))));
}

std::vector<ParameterGroup*> MeshModel::sharedGroups() {
  std::vector<ParameterGroup*> groups = {&field_.table(), &field_.encoder(), &field_.decoder()};
  if (part_.isBackground()) groups.push_back(&sky_);
  return groups;
}

std::unique_ptr<MeshLevel> MeshModel::makeLevel(uint32_t number, const std::vector<float>& displacements) {
  MeshLevel::Settings settings;
  settings.near = static_cast<float>(config_.near) * part_.halfBlockEdge;
  settings.minCosine = static_cast<float>(config_.minCosine);
  settings.opacityOffset = opacityOffset();
  settings.occupancyDecay = static_cast<float>(config_.occupancyDecay);
  settings.quads = config_.quads;
  settings.forTraining = isForTraining();
  return std::make_unique<MeshLevel>(device_, number, domain(number), settings, displacements);
}

void MeshModel::addCoarseLevels(uint64_t seed) {
  while (levels() < maxLevels()) levels_.push_back(mergeLevel(levels(), seed));
}

std::unique_ptr<MeshLevel> MeshModel::mergeLevel(uint32_t number, uint64_t seed) {
  MeshLevel& finer = level(number - 1);
  const OctahedraGrid& fine = finer.domain().grids.at(0);
  CHECK(finer.domain().grids.size() == 1u);
  const uint32_t n = fine.resolution;
  const std::vector<uint32_t> traced = finer.tracedCells();
  std::vector<uint32_t> cells;
  for (uint32_t cell = 0; cell < fine.cells(); ++cell)
    if (isSet(traced, cell)) cells.push_back(cell);
  const uint32_t listed = static_cast<uint32_t>(cells.size());

  // Logits of random points in the cells.
  const RandomStream random(seed, number);
  Array<float> logits = device_.array<float>(size_t{kPointsPerCell} * std::max(1u, listed)),
               positions = device_.array<float>(size_t{3} * kPointsAtATime);
  field_.reserve(kPointsAtATime);
  const uint64_t points = uint64_t{kPointsPerCell} * listed;
  std::vector<float> chunk(size_t{3} * kPointsAtATime);
  for (uint64_t first = 0; first < points; first += kPointsAtATime) {
    const uint32_t count = static_cast<uint32_t>(std::min<uint64_t>(kPointsAtATime, points - first));
    for (uint32_t i = 0; i < count; ++i) {
      const uint64_t point = first + i;
      const uint32_t cell = cells[point % listed], place[3] = {cell % n, cell / n % n, cell / (n * n)};
      for (uint32_t axis = 0; axis < 3; ++axis)
        chunk[3 * size_t{i} + axis] =
            (static_cast<float>(place[axis]) + random.uniform(3 * point + axis)) / static_cast<float>(n);
    }
    device_.write(positions.all(), std::span<const float>(chunk));
    field_.encode({count}, positions, Matrix<float>(logits.part(first, count), 1));
  }

  const OctahedraGrid grid = domain(number).grids.at(0);
  Array<float> opacities = device_.array<float>(fine.cells()), merged = device_.array<float>(size_t{3} * grid.cells());
  const Array<uint32_t> listedCells = device_.uploadArray(cells);
  MergeOctahedra merge;
  merge.resolution = n;
  merge.points = kPointsPerCell;
  merge.offset = opacityOffset();
  merge.cells = listedCells;
  merge.x = Matrix<const float>(logits.all(), 1);
  merge.displacements = finer.displacements().values;
  merge.opacities = opacities;
  merge.mergedDisplacements = merged;
  device_.run(merge);
  // A vertex at its limit towards the outside of a child is nearer to the wall of the parent than vertices may be.
  std::vector<float> displacements = device_.read(merged.all());
  for (float& displacement : displacements)
    displacement = std::clamp(displacement, -kMaxDisplacement, kMaxDisplacement);
  std::unique_ptr<MeshLevel> level = makeLevel(number, displacements);

  // A cell may hold a surface if one of its children may.
  const std::vector<float> occupancy = finer.occupancy().values();
  std::vector<bool> possible(grid.cells());
  for (uint32_t cell = 0; cell < fine.cells(); ++cell) {
    if (occupancy[cell] < 0) continue;  // excluded
    const uint32_t half = n / 2, place[3] = {cell % n / 2, cell / n % n / 2, cell / (n * n) / 2};
    possible[place[0] + half * (place[1] + half * place[2])] = true;
  }
  level->exclude(possible);
  return level;
}

bool MeshModel::allFinite() {
  bool finite = true;
  for (ParameterGroup* group : sharedGroups()) finite = finite && group->allFinite(device_);
  for (const auto& level : levels_) finite = finite && level->displacements().allFinite(device_);
  for (const CoarseAtlas& coarse : coarse_) finite = finite && coarse.texels.allFinite(device_);
  return finite;
}

void MeshModel::save(TensorSet& tensors, bool withMoments) {
  for (const ParameterGroup* group : sharedGroups()) tensors.add(device_, *group, withMoments);
  for (const auto& level : levels_) level->save(tensors, withMoments);
  if (!atlas_) return;
  tensors.add(kPatchEdgeTensor, std::vector<uint32_t>{atlas_->patchEdge});
  tensors.add("atlas.ranges", atlas_->ranges);
  saveFaces(tensors, "atlas.", atlas_->faces);
  if (const SurfaceCoverage& checked = atlas_->coverage; checked.pixels > 0) {
    tensors.add(kCoverageTensor,
                std::vector<uint32_t>{static_cast<uint32_t>(checked.pixels), static_cast<uint32_t>(checked.holes)});
  }
  for (uint32_t number = 1; coarseAtlas(number) != nullptr; ++number) {
    saveFaces(tensors, MeshLevel::tensorPrefix(number) + "atlas.", coarseAtlas(number)->faces);
    tensors.add(device_, coarseAtlas(number)->texels, withMoments);
  }
}

void MeshModel::setAtlas(MeshAtlas atlas) {
  atlas_ = std::move(atlas);
  level(0).limitToFaces(atlas_->faces);
}

void MeshModel::removeAtlas() {
  atlas_.reset();
  level(0).removeLimit();
  if (!coarse_.empty()) levels_.resize(1);
  coarse_.clear();
}

void MeshModel::addCoarseAtlas(FaceSet faces, const std::vector<float>& texels) {
  const uint32_t number = static_cast<uint32_t>(coarse_.size()) + 1;
  level(number).limitToFaces(faces);
  coarse_.push_back(
      {std::move(faces), ParameterGroup(device_, MeshLevel::tensorPrefix(number) + "texels", texels, isForTraining())});
}

void MeshModel::restoreAtlas(const fs::path& path, const Safetensors& file) {
  const auto edge = file.require(path, kPatchEdgeTensor, TensorType::u32).as<uint32_t>();
  const auto ranges = file.require(path, "atlas.ranges", TensorType::f32).as<float>();
  bool isValid = edge.size() == 1 && edge[0] == static_cast<uint32_t>(config_.patchTexels) &&
                 ranges.size() == 2 * MeshField::kFeatures;
  for (size_t f = 0; isValid && f < ranges.size(); f += 2)
    isValid = std::isfinite(ranges[f]) && std::isfinite(ranges[f + 1]) && ranges[f] <= ranges[f + 1];
  if (!isValid) throwOtherSettings(path, "atlas.");
  for (const float range : ranges) {
    if (std::abs(range) <= kLargestMeshFeature) continue;
    throw Error(path.string(), "tensor atlas.ranges", "has features beyond what a scene can hold",
                "train again, into another folder, with a lower --set learning_rate");
  }
  MeshAtlas atlas;
  atlas.patchEdge = edge[0];
  atlas.faces = restoreFaces(path, file, "atlas.", level(0).domain());
  atlas.ranges.assign(ranges.begin(), ranges.end());
  atlas.coverage = readCoverage(part_, path, file).value_or(SurfaceCoverage());
  setAtlas(std::move(atlas));
  for (uint32_t number = 1; number < levels(); ++number) {
    const std::string prefix = MeshLevel::tensorPrefix(number);
    if (!file.tensors.contains(prefix + "atlas.faces")) break;
    FaceSet faces = restoreFaces(path, file, prefix + "atlas.", level(number).domain());
    // Faces and vertices determine the number of texels.
    const uint32_t texels = TexelAtlas(*this, number, faces, atlas_->patchEdge).texels();
    addCoarseAtlas(std::move(faces), std::vector<float>(size_t{MeshField::kFeatures} * std::max(1u, texels)));
    loadGroup(device_, path, file, coarse_.back().texels);
  }
}

void MeshModel::restore(const fs::path& path, const Safetensors& file) {
  for (ParameterGroup* group : sharedGroups()) loadGroup(device_, path, file, *group);
  levels_.resize(1);
  levels_[0]->restore(path, file);
  const uint32_t stored = use_ == MeshUse::rendering ? 1 : countLevels(config_, part_, file);
  while (levels() < stored) {
    levels_.push_back(makeLevel(levels(), std::vector<float>(countDisplacements(domain(levels())))));
    levels_.back()->restore(path, file);
  }
  if (hasAtlas(file)) restoreAtlas(path, file);
  if (!allFinite())
    throw Error(path.string(), "", "has numbers that are not finite", "restore the file, or train again");
}

}  // namespace tessera
