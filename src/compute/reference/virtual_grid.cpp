#include "compute/virtual_grid.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

// The two texels along one axis and the interpolation weight of the upper one.
struct Pair {
  uint32_t texel[2];
  double share;
};

Pair pairAt(double position, uint32_t resolution) {
  const double u = position * resolution - 0.5, low = std::floor(u);
  const auto clamped = [&](double i) {
    return static_cast<uint32_t>(std::clamp(i, 0.0, static_cast<double>(resolution - 1)));
  };
  return {{clamped(low), clamped(low + 1)}, u - low};
}

double pairWeight(const Pair& pair, int upper) {
  return upper ? pair.share : 1 - pair.share;
}

}  // namespace

std::vector<VirtualCorner> virtualCorners(const VirtualGrid& grid, const Point& position) {
  std::vector<VirtualCorner> corners;
  Pair voxel[3], plane[3];
  for (int a = 0; a < 3; ++a) {
    voxel[a] = pairAt(position[a], grid.voxels);
    if (grid.planes > 0) plane[a] = pairAt(position[a], grid.planes);
  }
  for (int c = 0; c < 8; ++c) {
    const int upper[3] = {c & 1, c >> 1 & 1, c >> 2};
    const uint32_t texel =
        voxel[0].texel[upper[0]] + grid.voxels * (voxel[1].texel[upper[1]] + grid.voxels * voxel[2].texel[upper[2]]);
    corners.push_back(
        {texel, pairWeight(voxel[0], upper[0]) * pairWeight(voxel[1], upper[1]) * pairWeight(voxel[2], upper[2])});
  }
  for (int a = 0; a < 3 && grid.planes > 0; ++a) {
    const Pair &b = plane[a == 0 ? 1 : 0], &c = plane[a == 2 ? 1 : 2];
    for (int k = 0; k < 4; ++k) {
      const int upperB = k & 1, upperC = k >> 1;
      corners.push_back(
          {grid.planeTexel(a, b.texel[upperB], c.texel[upperC]), pairWeight(b, upperB) * pairWeight(c, upperC)});
    }
  }
  return corners;
}

size_t virtualRow(const VirtualGrid& grid, Indices marks, Indices ranks, uint32_t block, size_t sample, size_t corner,
                  uint32_t texel) {
  if (!grid.shareTexels) return sample * grid.corners() + corner;
  const size_t word = size_t{block} * grid.words() + texel / 32;
  return ranks[word] + static_cast<size_t>(std::popcount(marks[word] & ((1u << texel % 32) - 1)));
}

namespace {

// Shared by the operations: the samples, and the row of the texel of each corner.
struct Samples {
  const VirtualGrid& grid;
  Doubles positions;
  Indices blocks, marks, ranks;

  template <class Arguments>
  explicit Samples(const Arguments& a) : grid(a.grid) {
    const size_t samples = hostCount(a.samples);
    positions = doubles(a.positions, 3 * samples);
    blocks = indices(a.blockOfSample, samples);
    marks = indices(a.marks, a.marks.count);
    ranks = indices(a.ranks, a.ranks.count);
  }
  size_t count() const { return blocks.size(); }
  std::vector<VirtualCorner> corners(size_t sample) const {
    return virtualCorners(grid, {positions[3 * sample], positions[3 * sample + 1], positions[3 * sample + 2]});
  }
  size_t row(size_t sample, size_t corner, uint32_t texel) const {
    return virtualRow(grid, marks, ranks, blocks[sample], sample, corner, texel);
  }
};

double attributeRange(const VirtualGrid& grid, size_t attribute) {
  return attribute == 0 ? grid.densityRange : grid.featureRange;
}

}  // namespace

double quantised(const VirtualGrid& grid, double attribute) {
  return grid.quantise ? std::floor(255 * attribute + 0.5) / 255 : attribute;
}

Doubles virtualSample(const VirtualGrid& grid, std::span<const VirtualCorner> corners, View attributes) {
  Doubles sums(VirtualGrid::kAttributes);
  for (size_t k = 0; k < corners.size(); ++k)
    for (size_t f = 0; f < sums.size(); ++f) {
      sums[f] += corners[k].weight * attributeRange(grid, f) * (2 * attributes[k * sums.size() + f] - 1);
    }
  Doubles out = {std::min(sums[0] - 1, 15.0)};
  for (size_t f = 1; f < sums.size(); ++f) out.push_back(1 / (1 + std::exp(-sums[f])));
  return out;
}

void run(const DistinctTexels& a) {
  const VirtualGrid& grid = a.grid;
  const size_t samples = hostCount(a.samples), words = grid.words();
  const auto place = [&](size_t row, uint32_t texel) {
    if (row >= a.texelCapacity) return;
    const std::array<float, 3> position = grid.texelPosition(texel);
    std::copy(position.begin(), position.end(), hostPointer(a.texelPositions) + 3 * row);
  };
  const Doubles positions = doubles(a.positions, 3 * samples);
  const Indices blocks = indices(a.blockOfSample, samples);
  uint32_t* first = hostPointer(a.firstTexel);
  std::fill(first, first + a.blocks + 1, 0u);
  const auto sampleCorners = [&](size_t s) {
    return virtualCorners(grid, {positions[3 * s], positions[3 * s + 1], positions[3 * s + 2]});
  };
  if (!grid.shareTexels) {
    for (size_t s = 0; s < samples; ++s)
      for (size_t k = 0; k < grid.corners(); ++k) place(s * grid.corners() + k, sampleCorners(s)[k].texel);
    first[a.blocks] = static_cast<uint32_t>(samples * grid.corners());
    return;
  }
  uint32_t* marks = hostPointer(a.marks);
  uint32_t* ranks = hostPointer(a.ranks);
  std::fill(marks, marks + a.blocks * words, 0u);
  for (size_t s = 0; s < samples; ++s)
    for (const VirtualCorner& corner : sampleCorners(s))
      marks[blocks[s] * words + corner.texel / 32] |= 1u << corner.texel % 32;
  uint32_t next = 0;
  for (size_t block = 0; block < a.blocks; ++block) {
    first[block] = next;
    for (size_t word = 0; word < words; ++word) {
      ranks[block * words + word] = next;
      for (uint32_t bit = 0; bit < 32; ++bit)
        if (marks[block * words + word] >> bit & 1) place(next++, static_cast<uint32_t>(32 * word + bit));
    }
  }
  first[a.blocks] = next;
}

void run(const VirtualGridForward& a) {
  const Samples samples(a);
  const Doubles attributes = doubles(a.attributes, a.attributes.count);
  const Doubles steps = a.minAlpha > 0 ? doubles(a.runtimeSteps, samples.count()) : Doubles();
  constexpr size_t kWidth = VirtualGrid::kAttributes;
  const size_t texels = a.texels.capacity;
  Doubles logDensities, colours;
  for (size_t s = 0; s < samples.count(); ++s) {
    const auto corners = samples.corners(s);
    Doubles ofCorners;
    for (size_t k = 0; k < corners.size(); ++k) {
      const size_t row = samples.row(s, k, corners[k].texel);
      for (size_t f = 0; f < kWidth; ++f)
        ofCorners.push_back(row < texels ? quantised(a.grid, attributes[row * kWidth + f]) : 0.5);
    }
    Doubles sample = virtualSample(a.grid, corners, ofCorners);
    if (a.minAlpha > 0 && -std::expm1(-std::exp(sample[0]) * steps[s]) < a.minAlpha) sample[0] = VirtualGrid::kCulled;
    logDensities.push_back(sample[0]);
    colours.insert(colours.end(), sample.begin() + 1, sample.end());
  }
  store(a.logDensities, logDensities);
  store(a.colours, colours);
}

void run(const VirtualGridBackward& a) {
  const Samples samples(a);
  const Doubles logDensities = doubles(a.logDensities, samples.count()),
                densityGradients = doubles(a.logDensityGradients, samples.count());
  constexpr size_t kWidth = VirtualGrid::kAttributes, kColours = kWidth - 1;
  const Doubles colours = doubles(a.colours, kColours * samples.count()),
                colourGradients = doubles(a.colourGradients, kColours * samples.count());
  const size_t rows = hostCount(a.texels);
  Doubles gradients(rows * kWidth);
  for (size_t s = 0; s < samples.count(); ++s) {
    const auto corners = samples.corners(s);
    for (size_t k = 0; k < corners.size(); ++k) {
      const size_t row = samples.row(s, k, corners[k].texel);
      if (row >= rows) continue;
      for (size_t f = 0; f < kWidth; ++f) {
        double upstream = 0;  // gradient with respect to the sum
        if (f == 0) {
          if (logDensities[s] > VirtualGrid::kCulled / 2 && logDensities[s] < 15) upstream = densityGradients[s];
        } else {
          const double c = colours[s * kColours + f - 1];
          upstream = colourGradients[s * kColours + f - 1] * c * (1 - c);
        }
        gradients[row * kWidth + f] += upstream * corners[k].weight * 2 * attributeRange(a.grid, f);
      }
    }
  }
  store(a.attributeGradients, gradients);
}

}  // namespace tessera::reference
