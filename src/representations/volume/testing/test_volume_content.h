// For tests: small contents computed from functions, with consistent macroblocks and distances.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/random.h"
#include "representations/volume/content/volume_content.h"
#include "scene/axes.h"
#include "scene/contraction.h"

namespace tessera {

using Texel3 = std::array<uint32_t, 3>;

// The functions that give the texels of a part. Texels are indexed along x, y, z.
struct TestVolumeContent {
  std::function<uint8_t(const Texel3& voxel, int attribute)> voxel;
  // The texel of plane a at (column, row), which are the other two axes b < c.
  std::function<uint8_t(int plane, uint32_t column, uint32_t row, int attribute)> plane;
  std::function<bool(const Texel3& cell)> mayHoldSomething;  // cells of kDistanceCell³ plane texels
};

// Returns Chebyshev distances to the occupied cells of a grid of n³, computed as the number of times that they must
// grow by one cell to reach a cell.
inline std::vector<uint8_t> testDistances(std::vector<bool> holds, int n) {
  const int maximum = std::min(n, 255);
  std::vector<uint8_t> distances(holds.size(), static_cast<uint8_t>(maximum));
  for (int distance = 0; distance < maximum; ++distance) {
    for (size_t i = 0; i < holds.size(); ++i) {
      if (holds[i] && distances[i] == maximum) distances[i] = static_cast<uint8_t>(distance);
    }
    for (const int stride : {1, n, n * n}) {
      std::vector<bool> grown = holds;
      for (int i = 0; i < static_cast<int>(holds.size()); ++i) {
        if (!holds[i]) continue;
        if (i / stride % n > 0) grown[i - stride] = true;
        if (i / stride % n < n - 1) grown[i + stride] = true;
      }
      holds = grown;
    }
  }
  return distances;
}

// Fills in the texels, macroblocks and distances of a part whose placement and resolutions are set.
inline void makeVolume(VolumePart& part, const TestVolumeContent& content) {
  const uint32_t cells = part.planes / VolumePart::kDistanceCell, blocks = part.voxels / VolumePart::kMacroblock;
  std::vector<bool> holds;
  for (uint32_t z = 0; z < cells; ++z) {
    for (uint32_t y = 0; y < cells; ++y) {
      for (uint32_t x = 0; x < cells; ++x) holds.push_back(content.mayHoldSomething({x, y, z}));
    }
  }
  part.distances = testDistances(holds, static_cast<int>(cells));
  // The cells in which samples of a macroblock can lie: from half a voxel behind its first to half a voxel behind the
  // first of the next.
  const auto cellRange = [&](uint32_t block, uint32_t& first, uint32_t& last) {
    const double perVoxel = static_cast<double>(cells) / part.voxels;
    first = block == 0 ? 0 : static_cast<uint32_t>((8 * block + 0.49) * perVoxel);
    last = block + 1 == blocks ? cells - 1 : std::min(cells - 1, static_cast<uint32_t>((8 * block + 8.51) * perVoxel));
  };
  for (uint32_t z = 0; z < blocks; ++z) {
    for (uint32_t y = 0; y < blocks; ++y) {
      for (uint32_t x = 0; x < blocks; ++x) {
        uint32_t first[3], last[3];
        for (int a = 0; a < 3; ++a) cellRange(Texel3{x, y, z}[a], first[a], last[a]);
        bool stored = false;
        for (uint32_t k = first[2]; k <= last[2]; ++k) {
          for (uint32_t j = first[1]; j <= last[1]; ++j) {
            for (uint32_t i = first[0]; i <= last[0]; ++i) stored |= holds[i + cells * (j + size_t{cells} * k)];
          }
        }
        part.macroblocks.push_back(stored ? part.storedMacroblocks() : VolumePart::kEmpty);
        if (!stored) continue;
        const uint32_t maximum = part.voxels - 1;
        for (uint32_t k = 0; k < 9; ++k) {
          for (uint32_t j = 0; j < 9; ++j) {
            for (uint32_t i = 0; i < 9; ++i) {
              const Texel3 at = {std::min(8 * x + i, maximum), std::min(8 * y + j, maximum),
                                 std::min(8 * z + k, maximum)};
              for (int attribute = 0; attribute < 8; ++attribute)
                part.voxelBytes.push_back(content.voxel(at, attribute));
            }
          }
        }
      }
    }
  }
  for (int plane = 0; plane < 3; ++plane) {
    for (uint32_t row = 0; row < part.planes; ++row) {
      for (uint32_t column = 0; column < part.planes; ++column) {
        for (int a = 0; a < 8; ++a) part.planeBytes[plane].push_back(content.plane(plane, column, row, a));
      }
    }
  }
}

// Returns smooth random texels, with about `filled` of the cells occupied. Densities reach a few units.
inline TestVolumeContent smoothVolume(uint64_t seed, double filled = 0.3) {
  const auto wave = [seed](uint64_t stream, double x, double y, double z) {
    const RandomStream random(seed, stream);
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      const double phase = 6.28 * random.uniform(8 * i + 3);
      sum += std::sin((random.uniform(8 * i) - 0.5) * x + (random.uniform(8 * i + 1) - 0.5) * y +
                      (random.uniform(8 * i + 2) - 0.5) * z + phase);
    }
    return sum / 3;
  };
  const auto byte = [](double value) { return static_cast<uint8_t>(std::clamp(value, 0.0, 255.0)); };
  TestVolumeContent content;
  content.voxel = [=](const Texel3& v, int attribute) {
    return byte(131 + (attribute == 0 ? 30 : 60) * wave(attribute, v[0], v[1], v[2]));
  };
  content.plane = [=](int plane, uint32_t column, uint32_t row, int attribute) {
    return byte(129 + 20 * wave(16 + 8 * plane + attribute, 0.5 * column, 0.5 * row, 0));
  };
  content.mayHoldSomething = [=](const Texel3& cell) {
    const RandomStream random(seed, 99);
    return random.uniform((cell[0] / 2) + 1000 * (cell[1] / 2) + 1000000 * (cell[2] / 2)) < filled;
  };
  return content;
}

// Makes a part that is opaque where `solid`, with the given colour there; positions are in scene units. Surfaces lie
// about a third of a voxel inside of the centres of the outermost solid voxels' empty neighbours.
inline void makeSolid(VolumePart& part, const std::function<bool(const Vec3d&)>& solid,
                      const std::function<Vec3d(const Vec3d&)>& colour) {
  const int n = static_cast<int>(part.voxels);
  const double half = part.halfDomain();
  const auto place = [&part, n, half](const Texel3& voxel, Vec3d& x) {
    Triple<double> y;
    int beyond = 0;
    for (int a = 0; a < 3; ++a) {
      y[a] = -half + 2 * half * (voxel[a] + 0.5) / n;
      beyond += std::abs(y[a]) > 1;
    }
    if (part.contracted) y = uncontract(y);
    for (int a = 0; a < 3; ++a) x[a] = part.centre[a] + part.scale[a] * y[a];
    return beyond < 2;  // otherwise the voxel corresponds to no position
  };
  std::vector<bool> isSolid(size_t{part.voxels} * part.voxels * part.voxels);
  for (size_t i = 0; i < isSolid.size(); ++i) {
    Vec3d x;
    isSolid[i] =
        place({static_cast<uint32_t>(i % n), static_cast<uint32_t>(i / n % n), static_cast<uint32_t>(i / n / n)}, x) &&
        solid(x);
  }
  TestVolumeContent content;
  content.voxel = [&](const Texel3& voxel, int attribute) -> uint8_t {
    Vec3d x;
    if (attribute == 0) return isSolid[voxel[0] + n * (voxel[1] + size_t{part.voxels} * voxel[2])] ? 255 : 0;
    if (attribute > 3) return 128;
    place(voxel, x);
    const double c = std::clamp(colour(x)[attribute - 1], 0.002, 0.998);
    return static_cast<uint8_t>(
        std::lround(255 * (0.5 + (std::log(c / (1 - c)) - 0.08) / 14)));  // the three planes add 0.08
  };
  content.plane = [](int, uint32_t, uint32_t, int) -> uint8_t { return 128; };
  content.mayHoldSomething = [&](const Texel3& cell) {
    const int cells = static_cast<int>(part.planes / VolumePart::kDistanceCell), voxels = n / cells;
    int from[3], to[3];
    for (int a = 0; a < 3; ++a) {
      from[a] = std::max(0, static_cast<int>(cell[a]) * voxels - 1);
      to[a] = std::min(n - 1, (static_cast<int>(cell[a]) + 1) * voxels);
    }
    for (int z = from[2]; z <= to[2]; ++z) {
      for (int y = from[1]; y <= to[1]; ++y) {
        for (int x = from[0]; x <= to[0]; ++x) {
          if (isSolid[x + n * (y + static_cast<size_t>(n) * z)]) return true;
        }
      }
    }
    return false;
  };
  makeVolume(part, content);
}

inline std::vector<DenseLayer> randomNetwork(uint64_t seed, std::vector<uint32_t> widths = {34, 16, 16, 3}) {
  const RandomStream random(seed, 7);
  std::vector<DenseLayer> network;
  uint64_t index = 0;
  for (size_t i = 0; i + 1 < widths.size(); ++i) {
    DenseLayer layer{widths[i], widths[i + 1], {}, {}};
    for (uint32_t k = 0; k < layer.inputs * layer.outputs; ++k) layer.weights.push_back(random.uniform(index++) - 0.5f);
    for (uint32_t k = 0; k < layer.outputs; ++k) layer.biases.push_back(random.uniform(index++) - 0.5f);
    network.push_back(layer);
  }
  return network;
}

// Returns a network whose output Φ is practically 0 everywhere.
inline std::vector<DenseLayer> darkNetwork() {
  return {{34, 3, std::vector<float>(34 * 3, 0.0f), {-100, -100, -100}}};
}

inline VolumePart smoothPart(uint64_t seed, bool contracted, double filled = 0.3) {
  VolumePart part;
  part.contracted = contracted;
  part.voxels = 32;
  part.planes = 64;
  makeVolume(part, smoothVolume(seed, filled));
  return part;
}

// Places a part as a cell of a grid: sets its domain and the region that it owns.
inline void placeCell(VolumePart& part, float x, float y, float bottom = -1, float top = 1) {
  part.centre = {x, y, 0};
  part.low = {x - 1, y - 1, bottom};
  part.high = {x + 1, y + 1, top};
}

inline VolumeContent makeVolumeContent(std::vector<VolumePart> parts, std::vector<DenseLayer> network = darkNetwork()) {
  VolumeContent content;
  content.network = std::move(network);
  content.parts = std::move(parts);
  return content;
}

}  // namespace tessera
