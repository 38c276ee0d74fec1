#include "photogrammetry/photo_pairs.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <tuple>

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

// Returns the photos of each flight in the order in which they were taken.
std::map<int, std::vector<int>> flightsInOrder(const PhotoList& list) {
  std::map<int, std::vector<int>> flights;
  for (size_t i = 0; i < list.photos.size(); ++i) flights[list.photos[i].flight].push_back(static_cast<int>(i));
  for (auto& [flight, photos] : flights) {
    std::stable_sort(photos.begin(), photos.end(), [&](int a, int b) {
      return list.photos[static_cast<size_t>(a)].tags.takenAt.value_or(0) <
             list.photos[static_cast<size_t>(b)].tags.takenAt.value_or(0);
    });
  }
  return flights;
}

void pairInSequence(const PhotoList& list, const std::vector<bool>& tellPlace, const PairOptions& options,
                    std::set<PhotoPair>& pairs) {
  for (const auto& [flight, photos] : flightsInOrder(list)) {
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
  double overlap = 0;
  int a = 0, b = 0;  // indices into the footprints, the smaller one first

  int other(int one) const { return one == a ? b : a; }
};

bool hasMoreOverlap(const Candidate& x, const Candidate& y) {
  return std::tuple(-x.overlap, x.b - x.a, x.a) < std::tuple(-y.overlap, y.b - y.a, y.a);
}

// A spanning tree of footprints by overlap, of each group that overlaps, grown from one of them (Prim). It holds one
// pair of each footprint, not all pairs, of which a large survey has many millions.
class SpanningTree {
 public:
  explicit SpanningTree(size_t count) : best_(count), isInside_(count, false) {}

  // Returns the footprint that joins the tree next, and the pair by which it does: without overlap, if it begins a
  // group. To be called once for each footprint.
  std::pair<int, Candidate> grow() {
    std::optional<size_t> next;
    for (size_t i = 0; i < best_.size(); ++i)
      if (!isInside_[i] && (!next || hasMoreOverlap(best_[i], best_[*next]))) next = i;
    isInside_[*next] = true;
    return {static_cast<int>(*next), best_[*next]};
  }

  // Takes a pair of the footprint that has joined.
  void offer(int inside, const Candidate& pair) {
    const auto other = static_cast<size_t>(pair.other(inside));
    if (!isInside_[other] && hasMoreOverlap(pair, best_[other])) best_[other] = pair;
  }

 private:
  std::vector<Candidate> best_;  // by which each would join the tree, or has
  std::vector<bool> isInside_;
};

// Of the photos that overlap with one of a list, the one with the most overlap first, chooses those to pair it with.
class Partners {
 public:
  Partners(const PhotoList& list, const PairOptions& options)
      : list_(list), options_(options), inFlight_(list.photos.size()) {
    for (const auto& [flight, photos] : flightsInOrder(list))
      for (size_t i = 0; i < photos.size(); ++i) inFlight_[static_cast<size_t>(photos[i])] = static_cast<int>(i);
  }

  std::vector<int> choose(int photo, const std::vector<int>& byOverlap) const {
    std::vector<int> chosen;
    std::map<int, int> taken;  // by flight
    std::vector<int> skipped;  // near ones, for want of others
    int best = 0, near = 0, more = 0;
    for (const int other : byOverlap) {
      const bool isOwnFlight = flight(photo) == flight(other);
      const bool isNear = isOwnFlight && std::abs(place(photo) - place(other)) <= options_.sequence;
      const bool isBest = best < options_.partners && !(isNear && near >= options_.near);
      if (isNear && !isBest) skipped.push_back(other);
      if (!isBest && (isOwnFlight || taken[flight(other)] >= options_.otherFlight || more >= options_.otherFlights))
        continue;
      ++taken[flight(other)];
      best += isBest ? 1 : 0;
      near += isNear ? 1 : 0;
      more += isBest ? 0 : 1;
      chosen.push_back(other);
    }
    const auto left = static_cast<size_t>(std::max(0, options_.partners - best));
    skipped.resize(std::min(skipped.size(), left));
    chosen.insert(chosen.end(), skipped.begin(), skipped.end());
    return chosen;
  }

 private:
  int flight(int photo) const { return list_.photos[static_cast<size_t>(photo)].flight; }
  int place(int photo) const { return inFlight_[static_cast<size_t>(photo)]; }

  const PhotoList& list_;
  const PairOptions& options_;
  std::vector<int> inFlight_;  // the place of each photo in its flight
};

// Takes a time quadratic in the number of photos, and memory linear in it.
void pairByFootprint(const PhotoList& list, const std::vector<bool>& tellPlace, const PairOptions& options,
                     std::set<PhotoPair>& pairs) {
  const std::vector<PhotoFootprint> prints = photoFootprints(list, tellPlace);
  const double minCosine = std::cos(options.maxAngle * std::numbers::pi / 180);
  const auto photo = [&](int print) { return prints[static_cast<size_t>(print)].photo; };
  const Partners partners(list, options);
  SpanningTree tree(prints.size());  // whatever the angles, so that no photo stands alone
  std::vector<Candidate> candidates;
  std::vector<int> byOverlap;
  for (size_t step = 0; step < prints.size(); ++step) {
    const auto [own, joint] = tree.grow();
    if (joint.overlap > 0) pairs.insert(inOrder(photo(joint.a), photo(joint.b)));
    const PhotoFootprint& print = prints[static_cast<size_t>(own)];
    candidates.clear();
    for (int i = 0; i < static_cast<int>(prints.size()); ++i) {
      const PhotoFootprint& other = prints[static_cast<size_t>(i)];
      const Candidate candidate{i == own ? 0 : sharedShare(print, other), std::min(own, i), std::max(own, i)};
      if (candidate.overlap <= 0) continue;
      tree.offer(own, candidate);
      const double cosine = print.worldFromCamera.col(2).dot(other.worldFromCamera.col(2));
      if (candidate.overlap >= options.minOverlap && cosine >= minCosine) candidates.push_back(candidate);
    }
    std::sort(candidates.begin(), candidates.end(), hasMoreOverlap);
    byOverlap.clear();
    for (const Candidate& candidate : candidates) byOverlap.push_back(photo(candidate.other(own)));
    for (const int other : partners.choose(print.photo, byOverlap)) pairs.insert(inOrder(print.photo, other));
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
                         .near = 20,
                         .otherFlight = 20,
                         .otherFlights = 40,
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
