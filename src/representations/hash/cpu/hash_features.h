// Interpolates the features at positions in a part of a `hash` content (NGP-RT, eq. 6 to 8): coarse features and the
// weights of levels come from the lattice, fine features from tables.
#pragma once

#include <array>
#include <vector>

#include "representations/hash/content/hash_content.h"

namespace tessera {

// A part's data laid out for many look-ups. Keeps references to the content and the part.
class HashFeatures {
 public:
  HashFeatures(const HashContent& content, const HashPart& part);

  static constexpr uint32_t kMaxTables = HashPart::kMaxTables;
  // Where the bytes for a position are stored, so that they can be prefetched before they are interpolated.
  struct Lookup {
    float cornerFraction[3];
    const uint8_t* corner;  // the lowest of the eight corners
    float fraction[kMaxTables][3];
    alignas(32) uint32_t entry[kMaxTables][8];
  };
  // Fills in `lookup` for a position in [0,1]³ of the part's domain and prefetches its bytes. Returns false if the
  // position's corners are not stored.
  bool find(const float position[3], Lookup& lookup) const;
  // Interpolates the features: log density, diffuse r g b, 4 features.
  void mix(const Lookup& lookup, float features[8]) const;

  const HashPart& part() const { return *part_; }

  struct Table {
    const uint8_t* bytes;
    float scale;  // resolution - 1
    uint32_t resolution, entries, mask;
    bool hashed;
    alignas(32) std::array<float, 8> low, step;  // for each feature
  };
  struct Layout {
    float lattice;
    uint32_t macroblocks, columns;
    alignas(64) std::array<float, 16> low, step;  // for each column
    std::vector<Table> tables;
    bool varies;  // the weights of levels vary from place to place
    uint32_t logitsOfLevel;
    std::array<float, 2 * kMaxTables> weights;  // if they do not vary: [levels][logitsOfLevel], after the sigmoid
  };

 private:
  const HashPart* part_;
  Layout layout_;
};

}  // namespace tessera
