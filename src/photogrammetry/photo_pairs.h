// Which pairs of photos are compared in structure from motion. All pairs are a quadratic number; GPS, the gimbal and
// the sequence of a flight tell which can show the same places.
#pragma once

#include <utility>
#include <vector>

#include "photogrammetry/photo_list.h"

namespace tessera {

inline constexpr int kMaxLookAlikes = 50;  // of a photo, that are of use

using PhotoPair = std::pair<int, int>;  // indices into PhotoList::photos, the smaller one first

struct PairOptions {
  int all = 40;             // up to so many photos, all pairs
  int partners = 12;        // with how many others a photo is paired by overlap
  int near = 6;             // of these, at most so many of those that `sequence` counts, if others overlap
  int otherFlight = 2;      // with how many photos of each other flight that overlaps
  int otherFlights = 12;    // with how many photos in all for the sake of other flights, beside the partners
  int neighbours = 2;       // in the sequence of a flight, to each side
  int sequence = 10;        // the same, of photos without GPS
  int lookAlikes = 20;      // with how many photos that look alike a photo without GPS is paired
  double minOverlap = 0.2;  // share of a photo's pixels
  double maxAngle = 50;     // degrees between the optical axes
};

// For each photo of a list, others that look like it, the most similar one first: indices into the list.
using LookAlikes = std::vector<std::vector<int>>;

// Returns the photos of which the choice of pairs needs look-alikes: of too many for all pairs, those of which GPS does
// not tell what they show. In ascending order.
std::vector<int> photosForLookAlikes(const PhotoList& list, const PairOptions& options = {});

// Returns the pairs, sorted. With GPS, footprints on the ground decide, for photos without gimbal angles as if they
// looked straight down; photos with GPS whose footprints overlap are connected. Heights above the ground that are not
// known are those of the other photos, or follow from the distances of the photos; those that are known count for at
// least what a survey with little overlap has. Photos without GPS, those of which many have the same place and nothing
// else tells them apart, and those that look above the horizon are paired with those that look alike; `lookAlikes` may
// be empty.
std::vector<PhotoPair> choosePairs(const PhotoList& list, const LookAlikes& lookAlikes,
                                   const PairOptions& options = {});

// Returns more pairs for photos that these have not connected with the others: all that may show the same places.
std::vector<PhotoPair> chooseMorePairs(const PhotoList& list, const LookAlikes& lookAlikes,
                                       const std::vector<int>& photos);

}  // namespace tessera
