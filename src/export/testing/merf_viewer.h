// For tests: a reimplementation of MERF's public web viewer in double precision, after its sources (google-research,
// folder merf/webviewer/): the texture layout of index.js and viewdependency.js, and the equations of fragment.glsl and
// viewdependency.glsl. Texture filtering is exact rather than 8-bit. It shares no code with the exporter.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/image_io.h"

namespace tessera {

using ViewerPlace = std::array<double, 3>;  // position in g: y up; contracted where stated

class MerfViewer {
 public:
  explicit MerfViewer(const fs::path& folder) : folder_(folder) {
    const auto params = nlohmann::json::parse(readTextFile(folder / "scene_params.json"));
    planes_ = params.at("triplane_resolution");
    planeTexel_ = params.at("triplane_voxel_size");
    voxels_ = params.at("sparse_grid_resolution");
    voxel_ = params.at("sparse_grid_voxel_size");
    params.at("range_features").get_to(features_);
    params.at("range_density").get_to(density_);
    block_ = params.at("data_block_size");
    atlas_ = {params.at("atlas_width"), params.at("atlas_height"), params.at("atlas_depth")};
    EXPECT_EQ(params.at("slice_depth"), 1);
    EXPECT_EQ(params.at("num_slices"), atlas_[2]);
    loadPictures();
    for (int layer = 0; layer < 3; ++layer) loadLayer(params, layer);
  }

  bool occupied(size_t grid, const ViewerPlace& z) const {
    const int factor = kFactors[grid], n = (planes_ + factor - 1) / factor;
    int cell[3];
    for (int a = 0; a < 3; ++a) {
      const double minimum = std::floor((z[a] + 2) / (planeTexel_ * factor));
      cell[a] = nearest((minimum + minimum + 1) * 0.5 / n, n);
    }
    return occupancy_[grid].pixels[4 * (cell[0] + n * (cell[1] + size_t(n) * cell[2]))] > 0;
  }

  // Returns the sums of denormalised density, red, green, blue and four features at a contracted position; nothing
  // where the viewer skips it as empty.
  std::optional<std::array<double, 8>> lookUp(const ViewerPlace& z) const {
    for (size_t grid = 0; grid < kFactors.size(); ++grid) {
      if (!occupied(grid, z)) return std::nullopt;
    }
    const int blocks = (voxels_ + block_ - 1) / block_;
    int index[3];
    double inAtlas[3];
    for (int a = 0; a < 3; ++a) {
      const double u = (z[a] + 2) / voxel_ - 0.5, minimum = std::floor(u / block_) * block_;
      index[a] = nearest((minimum + minimum + block_) / (2.0 * blocks * block_), blocks);
      inAtlas[a] = std::clamp(u - minimum, 0.0, static_cast<double>(block_));
    }
    const uint8_t* place = &indices_.pixels[3 * (index[0] + blocks * (index[1] + size_t(blocks) * index[2]))];
    if (place[0] > 254) return std::nullopt;
    for (int a = 0; a < 3; ++a) inAtlas[a] = (inAtlas[a] + place[a] * (block_ + 1.0) + 0.5) / atlas_[a];
    std::array<double, 8> sums{};
    addAtlas(inAtlas, sums);
    for (int plane = 0; plane < 3; ++plane) {
      const int s = plane == 0 ? 1 : 0, t = plane == 2 ? 1 : 2;
      addPlane(plane, (z[s] + 2) / planeTexel_ / planes_, (z[t] + 2) / planeTexel_ / planes_, sums);
    }
    return sums;
  }

  // `direction`: a unit vector in g.
  std::array<double, 3> network(const std::array<double, 3>& colour, const std::array<double, 4>& features,
                                const ViewerPlace& direction) const {
    const double turned[3] = {-direction[0], direction[2], direction[1]};  // worldspaceROpengl
    std::vector<double> values(colour.begin(), colour.end());
    values.insert(values.end(), features.begin(), features.end());
    for (int i = 0; values.size() < layers_[0].weights.size(); ++i) {
      const double coordinate = turned[i % 3];
      const double angle = coordinate * std::pow(2.0, (i - 3) % 12 / 3) + (i - 3 >= 12 ? std::acos(-1.0) / 2 : 0);
      values.push_back(i < 3 ? coordinate : std::sin(angle));
    }
    for (double& value : values) value = std::abs(value) < 0.1 / 255 ? 0 : value;
    for (size_t l = 0; l < 3; ++l) {
      std::vector<double> next = layers_[l].biases;
      for (size_t i = 0; i < values.size(); ++i) {
        const double value = l == 0 ? values[i] : std::max(values[i], 0.0);
        for (size_t o = 0; o < next.size(); ++o) next[o] += layers_[l].weights[i][o] * value;
      }
      values = next;
    }
    return {1 / (1 + std::exp(-values[0])), 1 / (1 + std::exp(-values[1])), 1 / (1 + std::exp(-values[2]))};
  }

 private:
  struct Layer {
    std::vector<std::vector<double>> weights;  // [inputs][outputs], padded to multiples of 4
    std::vector<double> biases;
  };
  static constexpr std::array<int, 5> kFactors = {8, 16, 32, 64, 128};

  // Returns the nearest of n texels to a texture coordinate, clamped to the edge.
  static int nearest(double coordinate, int n) {
    return std::clamp(static_cast<int>(std::floor(coordinate * n)), 0, n - 1);
  }
  struct Mixed {
    int texel[2];
    double weight[2];
  };
  static Mixed linear(double coordinate, int n) {
    const double u = coordinate * n - 0.5, minimum = std::floor(u);
    const auto clamped = [n](double i) { return static_cast<int>(std::clamp(i, 0.0, n - 1.0)); };
    return {{clamped(minimum), clamped(minimum + 1)}, {1 - (u - minimum), u - minimum}};
  }

  // The viewer uses the bytes of a PNG as they are, so the number of channels must be right.
  ImageU8 picture(const std::string& name, int channels, int width, int height) const {
    ImageU8 image = readImage(folder_ / (name + ".png")).image;
    EXPECT_EQ(image.channels, channels) << name;
    EXPECT_EQ(image.width, width) << name;
    EXPECT_EQ(image.height, height) << name;
    return image;
  }
  void loadPictures() {
    for (int plane = 0; plane < 3; ++plane) {
      planePictures_[plane][0] = picture(fmt::format("plane_rgb_and_density_{}", plane), 4, planes_, planes_);
      planePictures_[plane][1] = picture(fmt::format("plane_features_{}", plane), 4, planes_, planes_);
    }
    for (int slice = 0; slice < atlas_[2]; ++slice) {
      slices_[0].push_back(picture(fmt::format("sparse_grid_rgb_and_density_{:03}", slice), 4, atlas_[0], atlas_[1]));
      slices_[1].push_back(picture(fmt::format("sparse_grid_features_{:03}", slice), 4, atlas_[0], atlas_[1]));
    }
    const int blocks = voxels_ / block_;
    indices_ = picture("sparse_grid_block_indices", 3, blocks, blocks * blocks);
    for (const int factor : kFactors) {
      const int n = (planes_ + factor - 1) / factor;
      occupancy_.push_back(picture(fmt::format("occupancy_grid_{}", factor), 4, n, n * n));
    }
  }

  // As createViewDependenceFunctions does: widths are padded to multiples of 4. Padding inputs sets the biases to 0.
  void loadLayer(const nlohmann::json& params, int number) {
    const auto weights = params.at(fmt::format("{}_weights", number)).get<std::vector<std::vector<double>>>();
    const auto biases = params.at(fmt::format("{}_bias", number)).get<std::vector<double>>();
    const auto filled = [](size_t width) { return (width + 3) / 4 * 4; };
    Layer& layer = layers_[number];
    layer.weights.assign(filled(weights.size()), std::vector<double>(filled(weights[0].size())));
    layer.biases.assign(filled(weights[0].size()), 0);
    for (size_t j = 0; j < layer.weights.size(); ++j) {
      for (size_t i = 0; i < layer.biases.size(); ++i) {
        const bool inside = j < weights.size() && i < weights[0].size();
        layer.weights[j][i] = inside ? weights[j][i] : 0;
        layer.biases[i] = inside ? std::round(biases[i] * 1e7) / 1e7 : 0;
      }
    }
  }

  // Adds the density in alpha and the colour of one image, and the four channels of the other, to the sums.
  void add(const uint8_t* rgbAndDensity, const uint8_t* features, double weight, std::array<double, 8>& sums) const {
    const auto mean = [](const std::array<double, 2>& range, uint8_t byte) {
      return range[0] + byte / 255.0 * (range[1] - range[0]);
    };
    sums[0] += weight * mean(density_, rgbAndDensity[3]);
    for (int c = 0; c < 3; ++c) sums[1 + c] += weight * mean(features_, rgbAndDensity[c]);
    for (int c = 0; c < 4; ++c) sums[4 + c] += weight * mean(features_, features[c]);
  }
  void addAtlas(const double uvw[3], std::array<double, 8>& sums) const {
    Mixed axis[3];
    for (int a = 0; a < 3; ++a) axis[a] = linear(uvw[a], atlas_[a]);
    for (int corner = 0; corner < 8; ++corner) {
      const int i = corner & 1, j = corner >> 1 & 1, k = corner >> 2;
      const double weight = axis[0].weight[i] * axis[1].weight[j] * axis[2].weight[k];
      add(slices_[0][axis[2].texel[k]].at(axis[0].texel[i], axis[1].texel[j]),
          slices_[1][axis[2].texel[k]].at(axis[0].texel[i], axis[1].texel[j]), weight, sums);
    }
  }
  void addPlane(int plane, double u, double v, std::array<double, 8>& sums) const {
    const Mixed s = linear(u, planes_), t = linear(v, planes_);
    for (int corner = 0; corner < 4; ++corner) {
      const int i = corner & 1, j = corner >> 1;
      add(planePictures_[plane][0].at(s.texel[i], t.texel[j]), planePictures_[plane][1].at(s.texel[i], t.texel[j]),
          s.weight[i] * t.weight[j], sums);
    }
  }

  fs::path folder_;
  int planes_ = 0, voxels_ = 0, block_ = 0;
  double planeTexel_ = 0, voxel_ = 0;
  std::array<double, 2> features_{}, density_{};
  std::array<int, 3> atlas_{};
  std::array<std::array<ImageU8, 2>, 3> planePictures_;
  std::array<std::vector<ImageU8>, 2> slices_;
  ImageU8 indices_;
  std::vector<ImageU8> occupancy_;
  std::array<Layer, 3> layers_;
};

}  // namespace tessera
