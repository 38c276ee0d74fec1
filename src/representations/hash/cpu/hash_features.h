// The features of places in a part of a `hash` content (NGP-RT, eq. 6 to 8): coarse ones and the weights of levels from
// the lattice, fine ones from tables.
#pragma once

#include <array>
#include <vector>

#include "representations/hash/content/hash_content.h"

namespace tessera {

// Laid out for looking many places up. Borrows the content and the part.
class HashFeatures {
 public:
  HashFeatures(const HashContent& content, const HashPart& part);

  static constexpr uint32_t kMostTables = HashPart::kMostTables;
  // Where a place's bytes lie: to be fetched ahead of being mixed.
  struct Lookup {
    float cornerFraction[3];
    const uint8_t* corner;  // the lowest of eight
    float fraction[kMostTables][3];
    alignas(32) uint32_t entry[kMostTables][8];
  };
  // `place` in [0,1]³ of the part's domain. False where its corners are not stored. Begins to fetch the bytes.
  bool find(const float place[3], Lookup& lookup) const;
  // The logarithm of density, diffuse r g b, 4 features.
  void mix(const Lookup& lookup, float features[8]) const;

  const HashPart& part() const { return *part_; }

  struct Table {
    const uint8_t* bytes;
    float scale;  // resolution - 1
    uint32_t resolution, entries, mask;
    bool hashed;
    alignas(32) std::array<float, 8> low, step;  // of each feature
  };
  struct Layout {
    float lattice;
    uint32_t macroblocks, columns;
    alignas(64) std::array<float, 16> low, step;  // of each column
    std::vector<Table> tables;
    // Of each level, its density's and its colours' weight where they are the same everywhere.
    bool varies;
    uint32_t logitsOfLevel;
    std::array<float, 2 * kMostTables> weights;
  };

 private:
  const HashPart* part_;
  Layout layout_;
};

}  // namespace tessera
