// What the committed scenes show, whatever the representation: 2 × 1 blocks with smooth ground, a building each; a
// merged level; a surround of each level. Arithmetic only, so that every machine makes the same bytes.
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
  Tileset tileset;                          // contents without uris
  std::map<std::string, Content> contents;  // by name: "0_0", "1_0", "all", "surround", "coarse_surround"
};

// Smooth, in [-1,1]: random values at whole numbers, mixed.
double noise(uint64_t stream, double x, double y);
// The logarithm of density: of rolling ground, and of one building in each block.
double logDensityAt(const Triple<double>& inScene);

// The place of a texel (x, y, z) of so many along each axis of a part's domain.
Triple<double> placeOfTexel(const ContentPart& part, const Triple<uint32_t>& texel, uint32_t count);
// Coordinates in the domain to the scene's.
Triple<double> inScene(const ContentPart& part, const Triple<double>& inDomain);
// A texel's coordinate along an axis of the domain.
double middle(const ContentPart& part, uint32_t index, uint32_t count);

// The logarithms of density at texels of a part's domain, so many along each axis.
class Densities {
 public:
  Densities(const ContentPart& part, uint32_t count);

  double at(uint32_t x, uint32_t y, uint32_t z) const { return values_[x + size_t{count_} * (y + size_t{count_} * z)]; }
  // Whether anything is dense among the texels from `first` to `last` along each axis, clamped, and not only hidden.
  bool isAnythingIn(const Triple<uint32_t>& first, const Triple<uint32_t>& last) const;

 private:
  uint32_t count_;
  std::vector<double> values_;
};

// Layers of 16, 16 and 3 outputs; `next`: the stream's next number.
std::vector<DenseLayer> makeNetwork(uint32_t inputs, const RandomStream& random, uint64_t& next);

// Of bytes, and with each weighed by its place, so that their order tells.
struct ByteSums {
  uint64_t sum = 0, ordered = 0;
};
ByteSums sumsOf(const std::vector<uint8_t>& bytes);

void placeBlock(ContentPart& part, uint32_t column);
void placeSurround(ContentPart& part);

// `texels`: that a finest block is fine, along an axis. Contents of tiles are "all" with the surrounds behind it, "0_0"
// and "1_0".
Tileset landscapeTileset(const std::string& representation, uint32_t texels);

}  // namespace tessera::golden
