#include "export/merf_layout.h"

#include "base/check.h"

namespace tessera {
namespace {

// Converts indices along the viewer's axes g to indices along our axes.
constexpr std::array<uint32_t, 3> ourAxes(const std::array<uint32_t, 3>& g) {
  return {g[2], g[0], g[1]};
}

void copyAttributes(const uint8_t* texel, const MerfPicture& picture, uint8_t* pixel) {
  for (const uint32_t attribute : picture.attributes) *pixel++ = texel[attribute];
}

// Returns the position of the m-th stored macroblock in the atlas: the last axis varies fastest, as in MERF.
std::array<uint32_t, 3> placeInAtlas(const std::array<uint32_t, 3>& atlas, uint32_t m) {
  return {m / (atlas[1] * atlas[2]), m / atlas[2] % atlas[1], m % atlas[2]};
}

}  // namespace

std::array<uint32_t, 3> merfAtlas(uint32_t stored) {
  constexpr uint32_t kMax = 2048 / VolumePart::kStoredEdge;
  std::array<uint32_t, 3> best = {0, 0, 0};
  uint64_t minimum = UINT64_MAX;
  for (uint32_t depth = 1; depth <= kMax; ++depth) {
    for (uint32_t height = depth; height <= kMax; ++height) {
      const uint32_t width = (stored + depth * height - 1) / (depth * height);
      const uint64_t all = uint64_t{width} * height * depth;
      if (width < height || width > kMax || all >= minimum) continue;
      best = {width, height, depth};
      minimum = all;
    }
  }
  CHECK(best[0] > 0u);
  return best;
}

ImageU8 merfPlane(const VolumePart& part, int plane, const MerfPicture& picture) {
  CHECK((plane >= 0 && plane < 3));
  const size_t s = plane == 0 ? 1 : 0, t = plane == 2 ? 1 : 2;
  constexpr int kOurs[] = {1, 2, 0};  // the axis of q along each axis of g
  const std::vector<uint8_t>& bytes = part.planeBytes[kOurs[plane]];
  // Our plane has the lower of its two axes along its columns.
  const bool swapped = kOurs[s] > kOurs[t];
  ImageU8 image(static_cast<int>(part.planes), static_cast<int>(part.planes), 4);
  for (uint32_t row = 0; row < part.planes; ++row) {
    for (uint32_t column = 0; column < part.planes; ++column) {
      const size_t texel = swapped ? size_t{part.planes} * column + row : size_t{part.planes} * row + column;
      copyAttributes(&bytes[texel * VolumePart::kAttributes], picture,
                     image.at(static_cast<int>(column), static_cast<int>(row)));
    }
  }
  return image;
}

ImageU8 merfAtlasSlice(const VolumePart& part, const std::array<uint32_t, 3>& atlas, uint32_t slice,
                       const MerfPicture& picture) {
  constexpr uint32_t kEdge = VolumePart::kStoredEdge;
  CHECK(slice < kEdge * atlas[2]);
  ImageU8 image(static_cast<int>(kEdge * atlas[0]), static_cast<int>(kEdge * atlas[1]), 4);
  for (uint32_t m = slice / kEdge; m < part.storedMacroblocks(); m += atlas[2]) {
    const std::array<uint32_t, 3> place = placeInAtlas(atlas, m);
    const uint8_t* macroblock = &part.voxelBytes[size_t{m} * VolumePart::kMacroblockBytes];
    for (uint32_t j = 0; j < kEdge; ++j) {
      for (uint32_t i = 0; i < kEdge; ++i) {
        const std::array<uint32_t, 3> voxel = ourAxes({i, j, slice % kEdge});
        copyAttributes(macroblock + ((voxel[2] * kEdge + voxel[1]) * kEdge + voxel[0]) * VolumePart::kAttributes,
                       picture,
                       image.at(static_cast<int>(kEdge * place[0] + i), static_cast<int>(kEdge * place[1] + j)));
      }
    }
  }
  return image;
}

ImageU8 merfBlockIndices(const VolumePart& part, const std::array<uint32_t, 3>& atlas) {
  const uint32_t edge = part.voxels / VolumePart::kMacroblock;
  ImageU8 image(static_cast<int>(edge), static_cast<int>(edge * edge), 3, 255);
  uint8_t* pixel = image.pixels.data();
  for (uint32_t z = 0; z < edge; ++z) {
    for (uint32_t y = 0; y < edge; ++y) {
      for (uint32_t x = 0; x < edge; ++x, pixel += 3) {
        const std::array<uint32_t, 3> ours = ourAxes({x, y, z});
        const uint32_t m = part.macroblocks[ours[0] + edge * (ours[1] + size_t{edge} * ours[2])];
        if (m == VolumePart::kEmpty) continue;
        const std::array<uint32_t, 3> place = placeInAtlas(atlas, m);
        for (int a = 0; a < 3; ++a) pixel[a] = static_cast<uint8_t>(place[a]);
      }
    }
  }
  return image;
}

ImageU8 merfOccupancy(const VolumePart& part, uint32_t factor) {
  CHECK(factor % VolumePart::kDistanceCell == 0u);
  const uint32_t cells = part.planes / VolumePart::kDistanceCell, side = factor / VolumePart::kDistanceCell;
  const uint32_t edge = (cells + side - 1) / side;
  ImageU8 image(static_cast<int>(edge), static_cast<int>(edge * edge), 4);
  size_t cell = 0;
  for (uint32_t z = 0; z < cells; ++z) {
    for (uint32_t y = 0; y < cells; ++y) {
      for (uint32_t x = 0; x < cells; ++x) {
        if (part.distances[cell++] > 0) continue;
        const size_t number = y / side + edge * (z / side + size_t{edge} * (x / side));
        std::fill_n(&image.pixels[4 * number], 4, uint8_t{1});
      }
    }
  }
  return image;
}

std::array<MerfLayer, 3> merfNetwork(const std::vector<DenseLayer>& network) {
  CHECK(network.size() == 3u);
  constexpr uint32_t kDirection = 7, kInputs = 36;
  std::array<MerfLayer, 3> layers;
  for (size_t l = 0; l < 3; ++l) {
    const DenseLayer& layer = network[l];
    layers[l].biases = layer.biases;
    layers[l].weights.assign(l == 0 ? kInputs : layer.inputs, std::vector<float>(layer.outputs));
    for (uint32_t input = 0; input < layer.inputs; ++input) {
      // Directions are encoded as d, sines and cosines, of three components each. The viewer's first component is our
      // second with its sign changed (which cosines ignore), and its second is our first.
      uint32_t from = input;
      bool negative = false;
      if (l == 0 && input >= kDirection) {
        const uint32_t number = input - kDirection, component = number % 3;
        if (component == 0) ++from;
        if (component == 1) --from;
        negative = component == 0 && number < 15;
      }
      for (uint32_t output = 0; output < layer.outputs; ++output) {
        const float weight = layer.weights[size_t{output} * layer.inputs + from];
        layers[l].weights[input][output] = negative ? -weight : weight;
      }
    }
  }
  return layers;
}

}  // namespace tessera
