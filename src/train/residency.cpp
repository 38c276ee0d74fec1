#include "train/residency.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/random.h"

namespace tessera {
namespace {

using Blocks = std::vector<uint32_t>;

size_t missingFrom(const Blocks& resident, const Blocks& set) {
  size_t missing = 0;
  for (const uint32_t block : set) missing += !std::binary_search(resident.begin(), resident.end(), block);
  return missing;
}

// Chooses a resident set greedily: repeatedly adds the block with the largest sum of demand over the sets that contain
// it and still fit, each divided by the number of its blocks that are missing.
Blocks nextResidentSet(const BlockSets& sets, const std::vector<double>& demand, uint32_t blocks, uint32_t resident) {
  Blocks chosen;
  while (chosen.size() < resident) {
    std::vector<double> gain(blocks);
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      const size_t missing = missingFrom(chosen, sets.sets[i]);
      if (missing == 0 || chosen.size() + missing > resident) continue;
      for (const uint32_t block : sets.sets[i]) {
        if (!std::binary_search(chosen.begin(), chosen.end(), block))
          gain[block] += demand[i] / static_cast<double>(missing);
      }
    }
    for (const uint32_t block : chosen) gain[block] = -1;
    const uint32_t best = static_cast<uint32_t>(std::max_element(gain.begin(), gain.end()) - gain.begin());
    chosen.insert(std::upper_bound(chosen.begin(), chosen.end(), best), best);
  }
  return chosen;
}

// Returns which sets must be served: all that fit except the rarest; of these still the heaviest with each block.
std::vector<bool> required(const BlockSets& sets, uint32_t blocks, uint32_t resident) {
  std::vector<size_t> byWeight;
  double total = 0;
  for (size_t i = 0; i < sets.sets.size(); ++i) {
    if (sets.sets[i].empty() || sets.sets[i].size() > resident) continue;
    byWeight.push_back(i);
    total += sets.weights[i];
  }
  std::stable_sort(byWeight.begin(), byWeight.end(),
                   [&](size_t a, size_t b) { return sets.weights[a] > sets.weights[b]; });
  std::vector<bool> required(sets.sets.size()), served(blocks);
  double sum = 0;
  for (const size_t i : byWeight) {
    const bool bringsABlock =
        std::any_of(sets.sets[i].begin(), sets.sets[i].end(), [&](uint32_t b) { return !served[b]; });
    required[i] = sum < (1 - Residency::kForgone) * total || bringsABlock;
    sum += sets.weights[i];
    if (!required[i]) continue;
    for (const uint32_t block : sets.sets[i]) served[block] = true;
  }
  return required;
}

}  // namespace

Residency::Residency(const BlockSets& sets, const Settings& settings) : settings_(settings) {
  CHECK(sets.sets.size() == sets.weights.size());
  CHECK(settings.resident >= 1u);
  CHECK(settings.resident <= settings.blocks);
  const std::vector<bool> must = required(sets, settings.blocks, settings.resident);
  constexpr double kServed = 1e-3;  // factor of the demand of sets that are already served
  std::vector<double> demand = sets.weights;
  const auto isLeft = [&](size_t i) { return must[i] && demand[i] == sets.weights[i] && sets.weights[i] > 0; };
  std::vector<double> servings(sets.sets.size());
  const auto add = [&](Blocks blocks) {
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      if (missingFrom(blocks, sets.sets[i]) > 0) continue;
      servings[i] += 1;
      demand[i] = kServed * sets.weights[i];
    }
    residentSets_.push_back({std::move(blocks), {}, 1});
  };
  const auto anyLeft = [&] {
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      if (isLeft(i)) return true;
    }
    return false;
  };
  while (anyLeft()) {
    const size_t before = residentSets_.size();
    Blocks blocks = nextResidentSet(sets, demand, settings.blocks, settings.resident);
    bool serves = false;
    for (size_t i = 0; i < sets.sets.size() && !serves; ++i)
      serves = isLeft(i) && missingFrom(blocks, sets.sets[i]) == 0;
    if (!serves) {  // the greedy choice serves no new set: add the heaviest set that is not served yet
      size_t heaviest = sets.sets.size();
      for (size_t i = 0; i < sets.sets.size(); ++i) {
        if (isLeft(i) && (heaviest == sets.sets.size() || sets.weights[i] > sets.weights[heaviest])) heaviest = i;
      }
      for (const uint32_t block : sets.sets[heaviest]) {
        if (std::binary_search(blocks.begin(), blocks.end(), block)) continue;
        // It replaces a block that the set does not contain.
        const auto place = std::find_if(blocks.begin(), blocks.end(), [&](uint32_t candidate) {
          return !std::binary_search(sets.sets[heaviest].begin(), sets.sets[heaviest].end(), candidate);
        });
        *place = block;
        std::sort(blocks.begin(), blocks.end());
      }
    }
    add(std::move(blocks));
    CHECK(residentSets_.size() == before + 1);
  }
  if (residentSets_.empty()) add(nextResidentSet(sets, demand, settings.blocks, settings.resident));

  double total = 0, served = 0;
  std::vector<bool> seen(settings.blocks), comesUp(settings.blocks);
  for (size_t i = 0; i < sets.sets.size(); ++i) {
    total += sets.weights[i];
    if (servings[i] > 0) served += sets.weights[i];
    for (const uint32_t block : sets.sets[i]) {
      seen[block] = seen[block] || sets.weights[i] > 0;
      comesUp[block] = comesUp[block] || servings[i] > 0;
    }
  }
  for (uint32_t block = 0; block < settings.blocks; ++block) {
    if (seen[block] && !comesUp[block]) neverServed_.push_back(block);
  }
  unserved_ = total > 0 ? 1 - served / total : 0;
  double ended = 0;
  for (ResidentSet& residentSet : residentSets_) {
    double weight = 0;
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      const bool there = missingFrom(residentSet.blocks, sets.sets[i]) == 0;
      residentSet.shareOfSet.push_back(there ? 1 / servings[i] : 0);
      if (there) weight += sets.weights[i] / servings[i];
    }
    const double begun = ended;
    ended += served > 0 ? weight / served : 1.0 / static_cast<double>(residentSets_.size());
    const double cycle = static_cast<double>(settings.cycleSteps);
    residentSet.steps = std::max<int64_t>(1, std::llround(ended * cycle) - std::llround(begun * cycle));
    cycleSteps_ += residentSet.steps;
  }
}

Residency::Position Residency::at(int64_t step) const {
  const int64_t cycle = step / cycleSteps_;
  std::vector<size_t> order(residentSets_.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const RandomStream random(settings_.seed, 0x5e51 + (static_cast<uint64_t>(cycle) << 16));
  for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i, static_cast<uint32_t>(i))]);
  int64_t into = step % cycleSteps_;
  for (const size_t residentSet : order) {
    if (into < residentSets_[residentSet].steps) return {residentSet, into};
    into -= residentSets_[residentSet].steps;
  }
  CHECK(false);
  return {};
}

}  // namespace tessera
