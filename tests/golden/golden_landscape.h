// What the committed scenes show, for all representations: 2 × 1 blocks with smooth ground and a building each, a
// merged level, and a background block of each level. Uses only arithmetic, so that every machine generates the same
// bytes.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "base/random.h"
#include "raymarch/content/content_part.h"
#include "scene/contraction.h"
#include "tiles/dense_layer.h"
#include "tiles/tileset.h"

namespace tessera::golden {

template <class Content>
struct Scene {
  Tileset tileset;  // contents have no uris
  // By name: "0_0", "1_0", "all", "background_block", "coarse_background_block".
  std::map<std::string, Content> contents;
};

// Smooth noise in [-1,1]: random values at integers, interpolated.
double noise(uint64_t stream, double x, double y);
// Returns the logarithm of the density of rolling ground with one building in each block.
double logDensityAt(const Triple<double>& inScene);

// Returns the position of texel (x, y, z) in the domain of a part with `count` texels along each axis.
Triple<double> placeOfTexel(const ContentPart& part, const Triple<uint32_t>& texel, uint32_t count);
// Converts coordinates in the part's domain to scene coordinates.
Triple<double> inScene(const ContentPart& part, const Triple<double>& inDomain);
// Returns the coordinate of a texel's centre along an axis of the domain.
double middle(const ContentPart& part, uint32_t index, uint32_t count);

// The logarithms of density at the texels of a part's domain, `count` along each axis.
class Densities {
 public:
  Densities(const ContentPart& part, uint32_t count);

  double at(uint32_t x, uint32_t y, uint32_t z) const { return values_[x + size_t{count_} * (y + size_t{count_} * z)]; }
  // Returns whether any of the texels from `first` to `last` along each axis (clamped) is dense and not merely hidden.
  bool isAnythingIn(const Triple<uint32_t>& first, const Triple<uint32_t>& last) const;

 private:
  uint32_t count_;
  std::vector<double> values_;
};

// Makes a network of layers with 16, 16 and 3 outputs; `next`: index of the stream's next number.
std::vector<DenseLayer> makeNetwork(uint32_t inputs, const RandomStream& random, uint64_t& next);

// The sum of bytes, and their sum weighted by position, which depends on their order.
struct ByteSums {
  uint64_t sum = 0, ordered = 0;
};
ByteSums computeSums(const std::vector<uint8_t>& bytes);

void placeBlock(ContentPart& part, uint32_t column);
void placeBackgroundBlock(ContentPart& part);

// `texels`: texels of a finest block along an axis, which determine its error. The tiles' contents are "all" with the
// background blocks behind it, "0_0" and "1_0".
Tileset landscapeTileset(const std::string& representation, uint32_t texels);

}  // namespace tessera::golden
