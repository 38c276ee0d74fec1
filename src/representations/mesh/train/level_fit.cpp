#include "representations/mesh/train/level_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "compute/patches.h"
#include "representations/mesh/train/texel_atlas.h"

namespace tessera {
namespace {

constexpr uint32_t kFeatures = MeshField::kFeatures;

// Of the planes of the triangles in a cell, in coordinates relative to its middle.
struct Quadric {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Vec3d b = Vec3d::Zero(), sum = Vec3d::Zero();
  double area = 0;

  void add(const Vec3d& normal, const Vec3d& at, double areaThere) {
    a += areaThere * normal * normal.transpose();
    b += areaThere * normal.dot(at) * normal;
    sum += areaThere * at;
    area += areaThere;
  }
  Vec3d minimum() const {
    constexpr double kAttraction = 0.2;  // of the middle, relative to that of a plane
    const Vec3d middle = sum / area;
    const Eigen::Matrix3d matrix = a / area + kAttraction * Eigen::Matrix3d::Identity();
    return middle + matrix.ldlt().solve((b - a * middle) / area);
  }
};

// What rays show of a face, at the texels of its triangle: those with the barycentric coordinates (T-1-i-j, i, j),
// divided by T - 1.
class FaceTexels {
 public:
  explicit FaceTexels(uint32_t edge) : edge_(edge), texels_(size_t{edge} * (edge + 1) / 2) {}

  struct Texel {
    float weight = 0, passed = 0;  // of the rays that see it, and of those that pass it
    std::array<float, kFeatures> sum{};
  };
  // The nearest texel.
  Texel& at(float second, float third) {
    const float last = static_cast<float>(edge_ - 1);
    std::array<float, 3> exact = {last * (1 - second - third), last * second, last * third}, off{};
    std::array<int, 3> rounded{};
    for (size_t i = 0; i < 3; ++i) {
      rounded[i] = static_cast<int>(std::lround(exact[i]));
      off[i] = std::abs(exact[i] - static_cast<float>(rounded[i]));
    }
    const size_t worst = static_cast<size_t>(std::max_element(off.begin(), off.end()) - off.begin());
    rounded[worst] += static_cast<int>(edge_) - 1 - rounded[0] - rounded[1] - rounded[2];
    const int most = static_cast<int>(edge_) - 1, i = std::clamp(rounded[1], 0, most);
    return texels_[index(static_cast<uint32_t>(i), static_cast<uint32_t>(std::clamp(rounded[2], 0, most - i)))];
  }
  const Texel& texel(uint32_t i, uint32_t j) const { return texels_[index(i, j)]; }

 private:
  size_t index(uint32_t i, uint32_t j) const { return size_t{j} * edge_ - size_t{j} * (j - 1) / 2 + i; }

  uint32_t edge_;
  std::vector<Texel> texels_;
};

// Follows rays to the surfaces of the finest level, and from there to the nearest face of another level.
class SurfaceTransfer final : public RayFollower {
 public:
  // Keeps a reference to `model`. reach: the largest distance between both, scene units.
  SurfaceTransfer(MeshModel& model, uint32_t level, double reach)
      : RayFollower(model.device()),
        model_(model),
        level_(level),
        reach_(static_cast<float>(reach)),
        patchEdge_(model.atlas()->patchEdge),
        faces_(model.level(level).domain().grids),
        fine_(model.device(), maxRays(), maxSamples()),
        coarse_(model.device(), maxRays(), maxSamples()),
        counters_(model.device().array<uint32_t>(size_t{2} * MeshHits::kCounters)),
        features_(model.device().array<float>(size_t{kFeatures} * maxSamples())) {
    fine_.counters = counters_.part(0, MeshHits::kCounters);
    coarse_.counters = counters_.part(MeshHits::kCounters, MeshHits::kCounters);
    model.field().reserve(maxSamples());
  }

  uint32_t follow(const MeshRays& rays, float rayWeight) override {
    Device& device = model_.device();
    model_.level(0).trace(rays, kMaxHits, false, fine_);
    model_.level(level_).trace(rays, kMaxHits, false, coarse_);
    model_.field().encode(fine_.samples(), fine_.positions, Matrix<float>(features_, kFeatures));
    const std::vector<uint32_t> counters = device.read(counters_.all());
    const uint32_t fineHits = counters[0], coarseHits = counters[MeshHits::kCounters],
                   followed = std::min(counters[1], counters[MeshHits::kCounters + 1]);
    CHECK(followed >= 1u);  // one ray's hits always fit
    const auto [directions, fineFirst, fineDistances, features] =
        device.readAll(rays.directions.part(0, size_t{3} * followed),
                       Slice<const uint32_t>(fine_.firstSample.part(0, followed + size_t{1})),
                       Slice<const float>(fine_.distances.part(0, fineHits)),
                       Slice<const float>(features_.part(0, size_t{kFeatures} * fineHits)));
    const auto [first, faces, barycentrics, distances] =
        device.readAll(Slice<const uint32_t>(coarse_.firstSample.part(0, followed + size_t{1})),
                       Slice<const uint32_t>(coarse_.faces.part(0, coarseHits)),
                       Slice<const float>(coarse_.barycentrics.part(0, size_t{2} * coarseHits)),
                       Slice<const float>(coarse_.distances.part(0, coarseHits)));
    for (uint32_t ray = 0; ray < followed; ++ray) {
      const Vec3f towards(directions[3 * ray], directions[3 * ray + 1], directions[3 * ray + 2]);
      const float reach = reach_ / towards.norm();
      float transmittance = 1;
      for (uint32_t i = fineFirst[ray]; i < fineFirst[ray + 1] && transmittance > kLeastTransmittance; ++i) {
        const float* const seen = &features[size_t{kFeatures} * i];
        const float opacity = 1 / (1 + std::exp(-seen[0] - model_.opacityOffset()));
        if (opacity < StoredOpacity::kTransparentBelow) continue;
        const float contribution = transmittance * opacity, weight = rayWeight * contribution;
        transmittance *= 1 - opacity;
        uint32_t nearest = first[ray + 1];
        float least = reach;
        for (uint32_t j = first[ray]; j < first[ray + 1]; ++j) {
          const float away = std::abs(distances[j] - fineDistances[i]);
          if (away >= least) continue;
          least = away;
          nearest = j;
        }
        if (nearest == first[ray + 1]) continue;
        faces_.add(faces[nearest], weight * towards.normalized(), contribution);
        const auto texel = [&](uint32_t j) -> FaceTexels::Texel& {
          return texels_.try_emplace(faces[j], patchEdge_)
              .first->second.at(barycentrics[2 * j], barycentrics[2 * j + 1]);
        };
        FaceTexels::Texel& shown = texel(nearest);
        shown.weight += weight;
        for (uint32_t f = 0; f < kFeatures; ++f) shown.sum[f] += weight * seen[f];
        if (contribution <= kPassingContribution) continue;
        for (uint32_t j = first[ray]; j < nearest; ++j) texel(j).passed += weight;
      }
    }
    return followed;
  }

  const FaceSet& faces() const { return faces_; }

  // Replaces the texels, [atlas.texels()][kFeatures], of those faces that are in the atlas, where rays see or pass
  // them.
  void setTexels(const TexelAtlas& atlas, std::vector<float>& texels) const {
    const uint32_t last = patchEdge_ - 1;
    const std::vector<uint32_t> patchOfFace = model_.device().read(atlas.patchOfFace());
    std::vector<FaceTexels::Texel> sums(texels.size() / kFeatures);  // two triangles share those of a common edge
    for (const auto& [face, ofFace] : texels_) {
      if (patchOfFace[face] == kNoPatch) continue;
      const size_t patch = patchOfFace[face] / 16;
      const uint32_t code = patchOfFace[face] % 16;
      const auto permutation = patchPermutation(code % kSecondTriangle);
      for (uint32_t j = 0; j <= last; ++j) {
        for (uint32_t i = 0; i + j <= last; ++i) {
          const std::array<uint32_t, 3> ofVertex = {last - i - j, i, j};
          std::array<uint32_t, 3> ofCorner{};
          for (size_t vertex = 0; vertex < 3; ++vertex) ofCorner[permutation[vertex]] = ofVertex[vertex];
          const bool isSecond = code >= kSecondTriangle;
          const uint32_t column = isSecond ? last - ofCorner[1] : ofCorner[1],
                         row = isSecond ? last - ofCorner[2] : ofCorner[2];
          FaceTexels::Texel& to = sums[(patch * patchEdge_ + row) * patchEdge_ + column];
          const FaceTexels::Texel& from = ofFace.texel(i, j);
          to.weight += from.weight;
          to.passed += from.passed;
          for (size_t f = 0; f < kFeatures; ++f) to.sum[f] += from.sum[f];
        }
      }
    }
    for (size_t number = 0; number < sums.size(); ++number) {
      const FaceTexels::Texel& sum = sums[number];
      float* const texel = &texels[kFeatures * number];
      for (size_t f = 0; f < kFeatures && sum.weight > 0; ++f) texel[f] = sum.sum[f] / sum.weight;
      if (sum.passed <= 0) continue;
      constexpr float kLeastOpacity = 0.02f;  // from which training can still raise it
      const float opacity = std::clamp(sum.weight / (sum.weight + sum.passed), kLeastOpacity, 1 - kLeastOpacity);
      texel[0] = std::min(texel[0], std::log(opacity / (1 - opacity)) - model_.opacityOffset());
    }
    std::vector<KnownTexel> known;
    for (const FaceTexels::Texel& sum : sums) {
      known.push_back(sum.weight > 0 ? KnownTexel::seen : sum.passed > 0 ? KnownTexel::passed : KnownTexel::unseen);
    }
    fillPatches(patchEdge_, std::move(known), texels);
  }

 private:
  static constexpr float kLeastTransmittance = 0.2f;   // as ExtractionSettings::maxOpacity
  static constexpr float kPassingContribution = 0.5f;  // a ray passes faces if it sees more of a surface behind them

  MeshModel& model_;
  uint32_t level_;
  float reach_;
  uint32_t patchEdge_;
  FaceSet faces_;
  MeshHits fine_, coarse_;
  Array<uint32_t> counters_;
  Array<float> features_;
  std::unordered_map<uint32_t, FaceTexels> texels_;  // by face
};

}  // namespace

void fillPatches(uint32_t edge, std::vector<KnownTexel> known, std::vector<float>& texels) {
  const int last = static_cast<int>(edge) - 1;
  const size_t texelsOfPatch = size_t{edge} * edge;
  for (size_t first = 0; first + texelsOfPatch <= known.size(); first += texelsOfPatch) {
    const auto at = [&](int column, int row) {
      return first + static_cast<size_t>(row) * edge + static_cast<size_t>(column);
    };
    for (std::vector<size_t> filled(1); !filled.empty();) {
      filled.clear();
      for (int row = 0; row <= last; ++row) {
        for (int column = 0; column <= last; ++column) {
          if (known[at(column, row)] != KnownTexel::unseen) continue;
          std::array<float, kFeatures> sum{};
          float count = 0;
          for (int j = std::max(0, row - 1); j <= std::min(last, row + 1); ++j)
            for (int i = std::max(0, column - 1); i <= std::min(last, column + 1); ++i) {
              if (known[at(i, j)] != KnownTexel::seen) continue;
              ++count;
              for (size_t f = 0; f < kFeatures; ++f) sum[f] += texels[kFeatures * at(i, j) + f];
            }
          if (count == 0) continue;
          for (size_t f = 0; f < kFeatures; ++f) texels[kFeatures * at(column, row) + f] = sum[f] / count;
          filled.push_back(at(column, row));
        }
      }
      for (const size_t texel : filled) known[texel] = KnownTexel::seen;
    }
  }
}

std::vector<float> fitVertices(const TriangleList& surface, const OctahedraGrid& grid,
                               std::vector<float> displacements) {
  constexpr double kReach = 0.98 * kMaxDisplacement, kLeastArea = 0.05;  // of the side of a cell
  constexpr int kPieces = 6;                                             // of a triangle, along an edge
  const int n = static_cast<int>(grid.resolution);
  std::unordered_map<int, Quadric> quadrics;  // by cell
  const auto toGrid = [&](const Vec3d& x) {
    Vec3d at;
    for (int axis = 0; axis < 3; ++axis) {
      const float* const m = grid.gridFromScene.data() + size_t{4} * axis;
      at[axis] = m[0] * x.x() + m[1] * x.y() + m[2] * x.z() + m[3];
    }
    return at;
  };
  for (const auto& triangle : surface.triangles) {
    const Vec3d a = toGrid(surface.vertices[triangle[0]]), b = toGrid(surface.vertices[triangle[1]]),
                c = toGrid(surface.vertices[triangle[2]]), cross = (b - a).cross(c - a);
    if (cross.isZero()) continue;
    const Vec3d normal = cross.normalized();
    const double area = cross.norm() / 2 / (kPieces * kPieces);
    for (int row = 0; row < kPieces; ++row) {
      for (int i = 0; i < 2 * (kPieces - row) - 1; ++i) {  // small triangles, of which every second one is upside down
        const double third = i % 2 == 0 ? 1.0 / 3 : 2.0 / 3;
        const Vec3d at = a + (i / 2 + third) / kPieces * (b - a) + (row + third) / kPieces * (c - a),
                    cell = at.array().floor();
        if ((cell.array() < 0).any() || (cell.array() >= n).any()) continue;
        quadrics[static_cast<int>(cell.x() + n * (cell.y() + n * cell.z()))].add(
            normal, at - cell - Vec3d::Constant(0.5), area);
      }
    }
  }
  for (const auto& [cell, quadric] : quadrics) {
    if (quadric.area < kLeastArea) continue;
    const Vec3d at = quadric.minimum().cwiseMax(-kReach).cwiseMin(kReach);
    for (int axis = 0; axis < 3; ++axis)
      displacements[3 * static_cast<size_t>(cell) + static_cast<size_t>(axis)] = static_cast<float>(at[axis]);
  }
  return displacements;
}

FittedLevel fitLevel(MeshModel& model, uint32_t number, const Capture& capture, const std::vector<TileShares>* tiles,
                     const ExtractionSettings& settings) {
  CHECK(model.atlas());
  CHECK(!model.part().isBackground());  // its grids are not affine
  Device& device = model.device();
  MeshLevel& finest = model.level(0);
  MeshLevel& level = model.level(number);
  const OctahedraDomain& fine = finest.domain();
  const TriangleList surface = listTriangles(fine.grids, fine.grids, device.read(finest.displacements().values.all()),
                                             model.atlas()->faces.bits());
  const OctahedraGrid& grid = level.domain().grids[0];
  const std::vector<float> displacements = fitVertices(surface, grid, device.read(level.displacements().values.all()));
  device.write(level.displacements().values.all(), std::span<const float>(displacements));

  SurfaceTransfer transfer(model, number, 1.0 / grid.gridFromScene[0]);
  followRays(model, number, capture, tiles, settings, transfer, [](int64_t, int64_t) {});
  FittedLevel fitted{transfer.faces(), {}};
  fitted.faces.dropLeast(settings.droppedShare);
  const TexelAtlas atlas(model, number, fitted.faces, model.atlas()->patchEdge);
  fitted.texels = atlas.encodeTexels(model);
  fitted.texels.resize(std::max<size_t>(kFeatures, fitted.texels.size()));  // nothing on a device is empty
  transfer.setTexels(atlas, fitted.texels);
  return fitted;
}

}  // namespace tessera
