#include "photogrammetry/photo_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

#include "photogrammetry/photo_footprints.h"

namespace tessera {
namespace {

double sharedShare(const PhotoFootprint& a, const PhotoFootprint& b) {
  if ((a.middle - b.middle).norm() > a.radius + b.radius) return 0;
  const auto shared = [](const PhotoFootprint& of, const PhotoFootprint& in) {
    const auto n = std::count_if(of.places.begin(), of.places.end(), [&](const Vec2d& x) { return in.shows(x); });
    return of.places.empty() ? 0 : static_cast<double>(n) / static_cast<double>(of.places.size());
  };
  // The mean: a photo from high above holds all of a lower one's footprint, which fills little of it.
  return 0.5 * (shared(a, b) + shared(b, a));
}

PhotoPair inOrder(int a, int b) {
  return {std::min(a, b), std::max(a, b)};
}

void pairInSequence(const PhotoList& list, const std::vector<bool>& tellPlace, const PairOptions& options,
                    std::set<PhotoPair>& pairs) {
  std::map<int, std::vector<int>> flights;
  for (size_t i = 0; i < list.photos.size(); ++i) flights[list.photos[i].flight].push_back(static_cast<int>(i));
  for (auto& [flight, photos] : flights) {
    std::stable_sort(photos.begin(), photos.end(), [&](int a, int b) {
      return list.photos[static_cast<size_t>(a)].tags.takenAt.value_or(0) <
             list.photos[static_cast<size_t>(b)].tags.takenAt.value_or(0);
    });
    for (size_t i = 0; i < photos.size(); ++i) {
      for (size_t k = i + 1; k < photos.size(); ++k) {
        const bool tell = tellPlace[static_cast<size_t>(photos[i])] && tellPlace[static_cast<size_t>(photos[k])];
        const auto distance = static_cast<int>(k - i);
        if (distance > std::max(options.neighbours, options.sequence)) break;
        if (distance <= (tell ? options.neighbours : options.sequence)) pairs.insert(inOrder(photos[i], photos[k]));
      }
    }
  }
}

struct Candidate {
  double overlap;
  int a, b;  // indices into the footprints
};

void pairByFootprint(const PhotoList& list, const std::vector<bool>& tellPlace, const PairOptions& options,
                     std::set<PhotoPair>& pairs) {
  const std::vector<PhotoFootprint> prints = photoFootprints(list, tellPlace);
  const double minCosine = std::cos(options.maxAngle * std::numbers::pi / 180);
  std::vector<std::vector<Candidate>> candidates(prints.size());
  std::vector<Candidate> all;
  for (size_t a = 0; a < prints.size(); ++a) {
    for (size_t b = a + 1; b < prints.size(); ++b) {
      const double overlap = sharedShare(prints[a], prints[b]);
      if (overlap <= 0) continue;
      const Candidate candidate{overlap, static_cast<int>(a), static_cast<int>(b)};
      all.push_back(candidate);
      const double cosine = prints[a].worldFromCamera.col(2).dot(prints[b].worldFromCamera.col(2));
      if (overlap < options.minOverlap || cosine < minCosine) continue;
      candidates[a].push_back(candidate);
      candidates[b].push_back(candidate);
    }
  }
  const auto byOverlap = [](const Candidate& x, const Candidate& y) {
    return std::tuple(-x.overlap, x.b - x.a, x.a) < std::tuple(-y.overlap, y.b - y.a, y.a);
  };
  const auto photo = [&](int print) { return prints[static_cast<size_t>(print)].photo; };
  for (size_t i = 0; i < prints.size(); ++i) {
    std::sort(candidates[i].begin(), candidates[i].end(), byOverlap);
    std::map<int, int> taken;  // by flight
    int count = 0;
    const int own = list.photos[static_cast<size_t>(prints[i].photo)].flight;
    for (const Candidate& candidate : candidates[i]) {
      const int other = candidate.a == static_cast<int>(i) ? candidate.b : candidate.a;
      const int flight = list.photos[static_cast<size_t>(photo(other))].flight;
      const bool isBest = count++ < options.partners;
      if (!isBest && (flight == own || taken[flight] >= options.otherFlight)) continue;
      ++taken[flight];
      pairs.insert(inOrder(prints[i].photo, photo(other)));
    }
  }
  // A spanning tree by overlap, whatever the angles, so that no photo stands alone.
  std::sort(all.begin(), all.end(), byOverlap);
  std::vector<int> root(prints.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&root](int i) {
    while (root[static_cast<size_t>(i)] != i)
      i = root[static_cast<size_t>(i)] = root[static_cast<size_t>(root[static_cast<size_t>(i)])];
    return i;
  };
  for (const Candidate& candidate : all) {
    const int a = find(candidate.a), b = find(candidate.b);
    if (a == b) continue;
    root[static_cast<size_t>(a)] = b;
    pairs.insert(inOrder(photo(candidate.a), photo(candidate.b)));
  }
}

void pairLookAlikes(const std::vector<bool>& tellPlace, const LookAlikes& lookAlikes, int partners,
                    std::set<PhotoPair>& pairs) {
  for (size_t i = 0; i < lookAlikes.size(); ++i) {
    int count = 0;
    for (const int other : lookAlikes[i]) {
      const auto o = static_cast<size_t>(other);
      if (count == partners) break;
      // Their places tell more, if they are known of both.
      if (other == static_cast<int>(i) || (tellPlace[i] && tellPlace[o])) continue;
      ++count;
      pairs.insert(inOrder(static_cast<int>(i), other));
    }
  }
}

}  // namespace

std::vector<int> photosForLookAlikes(const PhotoList& list, const PairOptions& options) {
  std::vector<int> photos;
  if (static_cast<int>(list.photos.size()) <= options.all) return photos;
  const std::vector<bool> tellPlace = tellFootprints(list);
  for (size_t i = 0; i < tellPlace.size(); ++i)
    if (!tellPlace[i]) photos.push_back(static_cast<int>(i));
  return photos;
}

std::vector<PhotoPair> choosePairs(const PhotoList& list, const LookAlikes& lookAlikes, const PairOptions& options) {
  std::set<PhotoPair> pairs;
  const int count = static_cast<int>(list.photos.size());
  if (count <= options.all) {
    for (int a = 0; a < count; ++a)
      for (int b = a + 1; b < count; ++b) pairs.emplace(a, b);
    return {pairs.begin(), pairs.end()};
  }
  const std::vector<bool> tellPlace = tellFootprints(list);
  pairInSequence(list, tellPlace, options, pairs);
  pairByFootprint(list, tellPlace, options, pairs);
  pairLookAlikes(tellPlace, lookAlikes, options.lookAlikes, pairs);
  return {pairs.begin(), pairs.end()};
}

std::vector<PhotoPair> chooseMorePairs(const PhotoList& list, const LookAlikes& lookAlikes,
                                       const std::vector<int>& photos) {
  const PairOptions wide{.all = 0,
                         .partners = 40,
                         .otherFlight = 20,
                         .neighbours = 10,
                         .sequence = 40,
                         .lookAlikes = kMaxLookAlikes,
                         .minOverlap = 0.02,
                         .maxAngle = 90};
  std::vector<PhotoPair> pairs = choosePairs(list, lookAlikes, wide);
  std::erase_if(pairs, [&](const PhotoPair& pair) {
    return std::find(photos.begin(), photos.end(), pair.first) == photos.end() &&
           std::find(photos.begin(), photos.end(), pair.second) == photos.end();
  });
  return pairs;
}

}  // namespace tessera
