// What the committed scenes show, whatever the representation: 2 × 1 blocks with smooth ground, a building each; a
// merged level; a surround of each level. Arithmetic only, so that every machine makes the same bytes.
#pragma once

#include <map>
#include <string>

#include "scene/contraction.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera::golden {

template <class Content>
struct Scene {
  Tileset tileset;                          // contents without uris
  std::map<std::string, Content> contents;  // by name: "0_0", "1_0", "all", "surround", "coarse_surround"
};

// Smooth, in [-1,1]: random values at whole numbers, mixed.
double noise(uint64_t stream, double x, double y);
// The height of what stands at x, y: rolling ground, and one building in each block.
double heightAt(double x, double y);

// The place of a texel (x, y, z) of so many along each axis of a part's domain.
Triple<double> placeOfTexel(const ContentPart& part, const Triple<uint32_t>& texel, uint32_t count);
// Coordinates in the domain to the scene's.
Triple<double> inScene(const ContentPart& part, const Triple<double>& inDomain);
// A texel's coordinate along an axis of the domain.
double middle(const ContentPart& part, uint32_t index, uint32_t count);

void placeBlock(ContentPart& part, uint32_t column);
void placeSurround(ContentPart& part);

// `texels`: that a finest block is fine, along an axis. Contents of tiles are "all" with the surrounds behind it, "0_0"
// and "1_0".
Tileset landscapeTileset(Representation representation, uint32_t texels);

}  // namespace tessera::golden
