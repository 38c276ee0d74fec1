#include "representations/hash/bake/bake_hash.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "compute/block_path.h"
#include "compute/lattice.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/content/occupancy_distance.h"
#include "representations/hash/train/hash_pipeline.h"
#include "train/photo_visitor.h"

namespace tessera {
namespace {

constexpr uint32_t kBakingRays = 2048, kBakingSamples = 1 << 16;  // of one batch of a photo's pixels
static_assert(kBakingSamples >= HashModel::kMaxSteps);
constexpr float kBakingMinTransmittance = 2e-3f;  // as in the paper
constexpr uint32_t kTexels = 1 << 16;             // evaluated in one batch
// Maximum number of occupancy cells along an edge of a block, unless the lattice is finer. Finer cells reduce the
// number of samples per ray: for the capture fox 8.5 with 256, 7.3 with 384, and 6.7 with 512, which takes 1.8 times
// the memory of 384.
constexpr uint32_t kMaxCells = 384;

// Marks the cells in which a model is visible through pixels: of all blocks, or of the background block alone.
class VisibilityMarker final : public PixelVisitor {
 public:
  VisibilityMarker(HashModel& model, const BakeHashOptions& options, std::vector<OccupancyBits>& seen)
      : model_(model),
        options_(options),
        seen_(seen),
        pipeline_(model, {kBakingRays, kBakingSamples, 8 * kBakingSamples, false}),
        imageRays_(model.device(), kBakingRays) {}

  void begin(const Photo& photo, const Camera& camera) override {
    imageRays_.begin(makeRayCamera(camera, photo.worldFromCamera, model_.frame()), model_.frame(), {});
  }
  // Rays that do not fit into one batch are processed in the next one.
  void visit(std::span<const float> pixels, SeenThrough through) override {
    const uint32_t firstBlock = through == SeenThrough::margin ? model_.space().cells() : 0;
    Device& device = model_.device();
    while (!pixels.empty()) {
      const ImageRays::Piece piece = imageRays_.through(pixels);
      pipeline_.forward({piece.rays, piece.origins, piece.directions, {}, {}, {}}, kBakingMinTransmittance);
      const RoundCounts counts(device.read(pipeline_.counters()), HashSamples::kRounds);
      const uint32_t samples = counts.visibleSamples, finished = counts.finished;
      CHECK(finished >= 1u);  // one ray's steps always fit
      const HashSamples& at = pipeline_.samples();
      const std::vector<uint32_t> first = device.read(at.firstSample.part(0, finished + size_t{1}));
      const std::vector<uint32_t> blocks = device.read(at.slotOfSample.part(0, samples));
      const std::vector<float> positions = device.read(at.positions.part(0, size_t{3} * samples));
      const std::vector<float> weights = device.read(pipeline_.weights().part(0, samples));
      for (uint32_t ray = 0; ray < finished; ++ray) {
        float transmittance = 1;
        for (uint32_t s = first[ray]; s < first[ray + 1]; ++s) {
          const float alpha = weights[s] / std::max(transmittance, 1e-9f);
          transmittance -= weights[s];
          if (blocks[s] >= firstBlock && weights[s] > options_.minWeight && alpha > options_.minAlpha)
            markCell(seen_[blocks[s]], &positions[3 * s]);
        }
      }
      pixels = pixels.subspan(size_t{2} * finished);
    }
  }

 private:
  static void markCell(OccupancyBits& bits, const float position[3]) {
    uint32_t cell[3];
    for (int a = 0; a < 3; ++a) {
      const double place = static_cast<double>(position[a]) * bits.cells;
      cell[a] = std::min(static_cast<uint32_t>(place), bits.cells - 1);
    }
    bits.set(bits.number(cell[0], cell[1], cell[2]));
  }

  HashModel& model_;
  const BakeHashOptions& options_;
  std::vector<OccupancyBits>& seen_;
  HashPipeline pipeline_;
  ImageRays imageRays_;
};

// Returns the smallest range that contains all values; one of values that are not numbers if one is not finite.
ByteRange findValueRange(const std::vector<float>& values, size_t first, size_t stride) {
  ByteRange range{0, 0};
  for (size_t i = first; i < values.size(); i += stride) {
    constexpr float kNotANumber = std::numeric_limits<float>::quiet_NaN();
    if (!std::isfinite(values[i])) return {kNotANumber, kNotANumber};
    range.low = i == first ? values[i] : std::min(range.low, values[i]);
    range.high = i == first ? values[i] : std::max(range.high, values[i]);
  }
  return range;
}

// Throws Error if the range exceeds the format's bounds, as after a training that diverged.
void requireWritable(const ByteRange& range) {
  if (range.low >= -kLargestFeature && range.high <= kLargestFeature) return;
  throw Error("the model", "",
              fmt::format("its features range from {} to {}, which scenes cannot store", range.low, range.high),
              "train it again with a lower --set learning_rate");
}

// Returns the macroblocks of which samples in visible cells interpolate corners.
std::vector<bool> markMacroblocks(const OccupancyBits& seen, uint32_t lattice) {
  const uint32_t blocks = lattice / HashPart::kMacroblock;
  std::vector<bool> marked(size_t{blocks} * blocks * blocks);
  const auto macroblockIndex = [&](double place) {  // of the lower corner of a sample at `place`, in cells
    const double u = std::clamp(place / seen.cells * lattice - 0.5, 0.0, lattice - 1.0);
    return static_cast<uint32_t>(u) / HashPart::kMacroblock;
  };
  for (size_t number = 0; number < seen.count(); ++number) {
    if (!seen.at(number)) continue;
    const size_t n = seen.cells;
    const double low[3] = {static_cast<double>(number % n), static_cast<double>(number / n % n),
                           static_cast<double>(number / n / n)};
    constexpr double kMargin = 1e-3;  // for float rounding errors
    const auto first = [&](int a) { return macroblockIndex(low[a] - kMargin); };
    const auto last = [&](int a) { return macroblockIndex(low[a] + 1 + kMargin); };
    for (uint32_t z = first(2); z <= last(2); ++z) {
      for (uint32_t y = first(1); y <= last(1); ++y) {
        for (uint32_t x = first(0); x <= last(0); ++x) marked[x + blocks * (y + size_t{blocks} * z)] = true;
      }
    }
  }
  return marked;
}

// Evaluates the coarse field of a block at the given corners of its lattice: [corners][LatticeForward::kColumns].
std::vector<float> cornerValues(HashModel& model, uint32_t block, const std::vector<uint32_t>& corners) {
  Device& device = model.device();
  BlockFields& coarse = model.fields().coarse();
  BlockFieldBatch batch(device, coarse.shape(), kTexels, false);
  Array<float> positions = device.array<float>(size_t{3} * kTexels);
  Array<uint32_t> firstOfSlot = device.array<uint32_t>(coarse.slots() + size_t{1});
  batch.positions = positions;
  batch.firstOfSlot = firstOfSlot;
  const VirtualGrid& lattice = model.fields().lattice();
  std::vector<float> values;
  values.reserve(corners.size() * LatticeForward::kColumns);
  for (size_t first = 0; first < corners.size(); first += kTexels) {
    const size_t count = std::min<size_t>(kTexels, corners.size() - first);
    std::vector<float> at;
    for (size_t i = first; i < first + count; ++i) {
      const std::array<float, 3> position = lattice.texelPosition(corners[i]);
      at.insert(at.end(), position.begin(), position.end());
    }
    device.write(positions.all(), std::span<const float>(at));
    std::vector<uint32_t> rows(coarse.slots() + size_t{1}, 0);
    std::fill(rows.begin() + block + 1, rows.end(), static_cast<uint32_t>(count));
    device.write(firstOfSlot.all(), std::span<const uint32_t>(rows));
    coarse.forward(batch, false);
    const std::vector<float> outputs = device.read(batch.outputs.part(0, count * LatticeForward::kColumns));
    values.insert(values.end(), outputs.begin(), outputs.end());
  }
  return values;
}

void bakeCorners(HashModel& model, uint32_t block, const OccupancyBits& seen, HashPart& part) {
  const AttentionShape& attention = model.fields().attention();
  const uint32_t used = HashPart::kFeatures + (attention.varies ? attention.logits() : 0);
  part.lattice = model.fields().lattice().voxels;
  part.columns = used > HashPart::kFeatures ? 2 * HashPart::kFeatures : HashPart::kFeatures;
  const uint32_t blocks = part.lattice / HashPart::kMacroblock, last = part.lattice - 1;
  const std::vector<bool> marked = markMacroblocks(seen, part.lattice);
  part.macroblocks.assign(marked.size(), HashPart::kEmpty);
  std::vector<uint32_t> corners;
  uint32_t stored = 0;
  for (uint32_t b = 0; b < marked.size(); ++b) {
    if (!marked[b]) continue;
    part.macroblocks[b] = stored++;
    const uint32_t origin[3] = {b % blocks * 8, b / blocks % blocks * 8, b / blocks / blocks * 8};
    for (uint32_t i = 0; i < HashPart::kStoredTexels; ++i) {
      const uint32_t x = std::min(origin[0] + i % 9, last), y = std::min(origin[1] + i / 9 % 9, last),
                     z = std::min(origin[2] + i / 81, last);
      corners.push_back(x + part.lattice * (y + part.lattice * z));
    }
  }
  const std::vector<float> values = cornerValues(model, block, corners);
  constexpr size_t kColumns = LatticeForward::kColumns;
  part.ranges.resize(part.columns);
  for (uint32_t c = 0; c < used; ++c) {
    part.ranges[c] = findValueRange(values, c, kColumns);
    requireWritable(part.ranges[c]);
  }
  part.cornerBytes.assign(corners.size() * part.columns, 0);
  for (size_t i = 0; i < corners.size(); ++i) {
    for (uint32_t c = 0; c < used; ++c) {
      part.cornerBytes[i * part.columns + c] = part.ranges[c].encodeByte(values[i * kColumns + c]);
    }
  }
}

// Returns the entries that a sample in a visible cell may read; empty if these are nearly all entries.
std::vector<bool> readEntries(const HashGridLevel& level, const OccupancyBits& seen) {
  constexpr uint64_t kNearlyAll = 4;  // with this many look-ups per entry, about one entry in fifty is not read
  const double edge = static_cast<double>(level.resolution - 1) / seen.cells;  // of a cell, in grid points
  const uint64_t points = static_cast<uint64_t>(std::ceil(edge)) + 2;
  uint64_t cells = 0;
  for (const uint64_t word : seen.words) cells += static_cast<uint64_t>(std::popcount(word));
  if (cells * points * points * points >= kNearlyAll * level.entries) return {};
  std::vector<bool> read(level.entries);
  for (size_t number = 0; number < seen.count(); ++number) {
    if (!seen.at(number)) continue;
    const size_t n = seen.cells, cell[3] = {number % n, number / n % n, number / n / n};
    uint32_t first[3], last[3];
    for (int a = 0; a < 3; ++a) {  // with a margin for float rounding errors
      const double low = static_cast<double>(cell[a]) * edge + 0.5, high = low + edge;
      first[a] = static_cast<uint32_t>(std::max(0.0, low - 1e-3));
      last[a] = static_cast<uint32_t>(high + 1e-3) + 1;
    }
    for (uint32_t z = first[2]; z <= last[2]; ++z) {
      for (uint32_t y = first[1]; y <= last[1]; ++y) {
        for (uint32_t x = first[0]; x <= last[0]; ++x) read[hashGridIndex(level, x, y, z)] = true;
      }
    }
  }
  return read;
}

void bakeTables(HashModel& model, uint32_t block, const OccupancyBits& seen, HashPart& part) {
  const HashGrid& grid = model.fields().fineGrid();
  for (const HashGridLevel& level : grid.levels) {
    HashTable table;
    table.resolution = level.resolution;
    table.entries = level.entries;
    table.hashed = level.hashed;
    std::vector<float> values = model.device().read(model.fields().fine(block).values.part(
        level.firstEntry * HashPart::kFeatures, size_t{level.entries} * HashPart::kFeatures));
    const std::vector<bool> read = readEntries(level, seen);
    for (size_t i = 0; i < values.size() && !read.empty(); ++i) {
      if (!read[i / HashPart::kFeatures]) values[i] = 0;  // entries that are never read then compress well
    }
    for (uint32_t f = 0; f < HashPart::kFeatures; ++f) {
      table.ranges[f] = findValueRange(values, f, HashPart::kFeatures);
      requireWritable(table.ranges[f]);
    }
    table.bytes.reserve(values.size());
    for (size_t i = 0; i < values.size(); ++i) {
      table.bytes.push_back(table.ranges[i % HashPart::kFeatures].encodeByte(values[i]));
    }
    part.tables.push_back(std::move(table));
  }
}

std::vector<DenseLayer> readDenseLayers(HashModel& model) {
  const MlpShape shape = model.config().directionShape();
  const std::vector<float> weights = model.device().read(model.direction().values.all());
  std::vector<DenseLayer> layers;
  for (int l = 0; l < shape.layers(); ++l) {
    DenseLayer layer;
    layer.inputs = static_cast<uint32_t>(l == 0 ? shape.inputs : shape.width);
    layer.outputs = static_cast<uint32_t>(l + 1 == shape.layers() ? shape.outputs : shape.width);
    for (uint32_t o = 0; o < layer.outputs; ++o) {  // without the padding of the inputs
      const auto row =
          weights.begin() + static_cast<ptrdiff_t>(shape.weightOffset(l) + size_t{o} * shape.layerInputs(l));
      layer.weights.insert(layer.weights.end(), row, row + layer.inputs);
    }
    layer.biases.assign(layer.outputs, 0);
    layers.push_back(std::move(layer));
  }
  return layers;
}

float computeStepLength(const HashModel& model) {
  return static_cast<float>(model.stepScale()) * model.config().longestStep();
}

}  // namespace

void requireBakeable(const HashModel& model) {
  if (model.config().mixesByNetwork()) {
    throw Error("--set aggregation=mlp", "", "a network for each sample cannot be baked", "train with attention");
  }
  const float step = computeStepLength(model);
  if (step >= kShortestHashStep && step <= kLongestHashStep) return;
  throw Error(fmt::format("--set max_ray_step={}", model.config().maxRayStep), "",
              fmt::format("rays take steps of {} of a block, where scenes have {} to {}", step, kShortestHashStep,
                          kLongestHashStep),
              "train with another one");
}

std::vector<OccupancyBits> findSeenCells(HashModel& model, const Capture& capture, const BakeHashOptions& options) {
  const uint32_t lattice = model.fields().lattice().voxels;
  const uint32_t cells = options.cells > 0
                             ? options.cells
                             : std::min(std::max(lattice, std::min(3 * lattice, kMaxCells)), kMaxOccupancyCells);
  std::vector<OccupancyBits> seen(model.space().blocks(), OccupancyBits(cells));
  VisibilityMarker finder(model, options, seen);
  const bool backgroundBlock = model.space().blocks() > model.space().cells();
  PhotoVisitor(capture, model.frame(), kBakingRays, finder)
      .visitAll(options.stride, {backgroundBlock, true}, options.onStep);
  for (OccupancyBits& bits : seen) {
    for (int i = 0; i < options.dilation; ++i) bits = dilated(bits);
  }
  return seen;
}

HashPart bakeHashPart(HashModel& model, uint32_t block, const OccupancyBits& seen) {
  const BlockSpace& space = model.space();
  HashPart part;
  const BlockSpace::Placement placement = space.placement(block);
  std::copy_n(placement.centre, 3, part.centre.begin());
  std::copy_n(placement.scale, 3, part.scale.begin());
  part.contracted = placement.contracted;
  const BlockSpace::Box owned = space.owned(block);
  part.low = owned.low;
  part.high = owned.high;
  part.backgroundBlock = block >= space.cells();
  bakeCorners(model, block, seen, part);
  bakeTables(model, block, seen, part);
  part.occupied = pyramidFromOccupancy(seen);
  part.distances = octantDistances(part.occupied);
  return part;
}

HashContent bakeHashGroup(HashModel& model, const std::vector<uint32_t>& blocks,
                          const std::vector<OccupancyBits>& seen) {
  requireBakeable(model);
  const AttentionShape& attention = model.fields().attention();
  HashContent content;
  content.weights = attention.weights == AttentionWeights::none     ? LevelWeights::none
                    : attention.weights == AttentionWeights::shared ? LevelWeights::shared
                                                                    : LevelWeights::separate;
  if (!attention.varies && attention.logits() > 0) {
    content.logits = model.device().read(model.fields().logits().values.all());
  }
  content.step = computeStepLength(model);
  content.hasLearnedBackground = model.config().background == "learned";
  content.network = readDenseLayers(model);
  for (const uint32_t block : blocks) content.parts.push_back(bakeHashPart(model, block, seen[block]));
  return content;
}

}  // namespace tessera
