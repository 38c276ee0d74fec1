#include "representations/mesh/train/mesh_model.h"

#include <algorithm>

#include "base/random.h"
#include "train/run_folder.h"

namespace tessera {
namespace {

constexpr uint32_t kPointsPerCell = 16;  // at which the opacities of cells are compared
constexpr uint32_t kPointsAtATime = 1 << 16;

bool isSet(const std::vector<uint32_t>& bits, size_t i) {
  return (bits[i / 32] >> i % 32 & 1) != 0;
}

}  // namespace

MeshModel::MeshModel(Device& device, const MeshConfig& config, const SceneFrame& frame)
    : device_(device),
      config_(config),
      frame_(frame),
      field_(device, config.shape(), static_cast<uint64_t>(config.seed)) {
  levels_.push_back(makeLevel(0, std::vector<float>(size_t{3} * config.grid(0).cells())));
}

std::unique_ptr<MeshLevel> MeshModel::makeLevel(uint32_t number, const std::vector<float>& displacements) {
  MeshLevel::Settings settings;
  settings.near = static_cast<float>(config_.near);
  settings.minCosine = static_cast<float>(config_.minCosine);
  settings.opacityOffset = opacityOffset();
  settings.occupancyDecay = static_cast<float>(config_.occupancyDecay);
  return std::make_unique<MeshLevel>(device_, number, config_.grid(number), settings, displacements);
}

void MeshModel::addCoarseLevels(uint64_t seed) {
  while (levels() < config_.levels()) levels_.push_back(mergeLevel(levels(), seed));
}

std::unique_ptr<MeshLevel> MeshModel::mergeLevel(uint32_t number, uint64_t seed) {
  MeshLevel& finer = level(number - 1);
  const uint32_t n = finer.grid().resolution;
  const std::vector<uint32_t> traced = finer.tracedCells();
  std::vector<uint32_t> cells;
  for (uint32_t cell = 0; cell < finer.grid().cells(); ++cell)
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

  const OctahedraGrid grid = config_.grid(number);
  Array<float> opacities = device_.array<float>(finer.grid().cells()),
               merged = device_.array<float>(size_t{3} * grid.cells());
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
  std::unique_ptr<MeshLevel> level = makeLevel(number, device_.read(merged.all()));

  // A cell may hold a surface if one of its children may.
  const std::vector<float> occupancy = finer.occupancy().values();
  std::vector<bool> possible(grid.cells());
  for (uint32_t cell = 0; cell < finer.grid().cells(); ++cell) {
    if (occupancy[cell] < 0) continue;  // excluded
    const uint32_t half = n / 2, place[3] = {cell % n / 2, cell / n % n / 2, cell / (n * n) / 2};
    possible[place[0] + half * (place[1] + half * place[2])] = true;
  }
  level->exclude(possible);
  return level;
}

bool MeshModel::allFinite() {
  bool finite =
      field_.table().allFinite(device_) && field_.encoder().allFinite(device_) && field_.decoder().allFinite(device_);
  for (const auto& level : levels_) finite = finite && level->displacements().allFinite(device_);
  return finite;
}

void MeshModel::save(TensorSet& tensors, bool withMoments) {
  for (const ParameterGroup* group : {&field_.table(), &field_.encoder(), &field_.decoder()}) {
    tensors.add(device_, *group, withMoments);
  }
  for (const auto& level : levels_) level->save(tensors, withMoments);
}

void MeshModel::restore(const fs::path& path, const Safetensors& file) {
  for (ParameterGroup* group : {&field_.table(), &field_.encoder(), &field_.decoder()}) {
    loadGroup(device_, path, file, *group);
  }
  levels_.resize(1);
  levels_[0]->restore(path, file);
  while (levels() < config_.levels() && file.tensors.contains(MeshLevel::tensorPrefix(levels()) + "displacements")) {
    levels_.push_back(makeLevel(levels(), std::vector<float>(size_t{3} * config_.grid(levels()).cells())));
    levels_.back()->restore(path, file);
  }
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
