#include "train/residency.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/random.h"

namespace tessera {
namespace {

using Blocks = std::vector<uint32_t>;

size_t missingFrom(const Blocks& held, const Blocks& set) {
  size_t missing = 0;
  for (const uint32_t block : set) missing += !std::binary_search(held.begin(), held.end(), block);
  return missing;
}

// Greedy: adds the block that brings most of the wanted weight nearest to being served, until no more fit.
Blocks nextStay(const BlockSets& sets, const std::vector<double>& wanted, uint32_t blocks, uint32_t resident) {
  Blocks held;
  while (held.size() < resident) {
    std::vector<double> gain(blocks);
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      const size_t missing = missingFrom(held, sets.sets[i]);
      if (missing == 0 || held.size() + missing > resident) continue;
      for (const uint32_t block : sets.sets[i]) {
        if (!std::binary_search(held.begin(), held.end(), block))
          gain[block] += wanted[i] / static_cast<double>(missing);
      }
    }
    for (const uint32_t block : held) gain[block] = -1;
    const uint32_t best = static_cast<uint32_t>(std::max_element(gain.begin(), gain.end()) - gain.begin());
    held.insert(std::upper_bound(held.begin(), held.end(), best), best);
  }
  return held;
}

// The sets that must be served: all that can be, but the rarest; of those again the heaviest with each block.
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
  constexpr double kServed = 1e-3;  // what is served already, but fits as well
  std::vector<double> wanted = sets.weights;
  const auto isLeft = [&](size_t i) { return must[i] && wanted[i] == sets.weights[i] && sets.weights[i] > 0; };
  std::vector<double> servings(sets.sets.size());
  const auto add = [&](Blocks blocks) {
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      if (missingFrom(blocks, sets.sets[i]) > 0) continue;
      servings[i] += 1;
      wanted[i] = kServed * sets.weights[i];
    }
    stays_.push_back({std::move(blocks), {}, 1});
  };
  const auto anyLeft = [&] {
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      if (isLeft(i)) return true;
    }
    return false;
  };
  while (anyLeft()) {
    const size_t before = stays_.size();
    Blocks blocks = nextStay(sets, wanted, settings.blocks, settings.resident);
    bool serves = false;
    for (size_t i = 0; i < sets.sets.size() && !serves; ++i)
      serves = isLeft(i) && missingFrom(blocks, sets.sets[i]) == 0;
    if (!serves) {  // greed went astray: begin with the heaviest set that is left
      size_t heaviest = sets.sets.size();
      for (size_t i = 0; i < sets.sets.size(); ++i) {
        if (isLeft(i) && (heaviest == sets.sets.size() || sets.weights[i] > sets.weights[heaviest])) heaviest = i;
      }
      for (const uint32_t block : sets.sets[heaviest]) {
        if (std::binary_search(blocks.begin(), blocks.end(), block)) continue;
        // In the place of one that the set does not ask for.
        const auto place = std::find_if(blocks.begin(), blocks.end(), [&](uint32_t held) {
          return !std::binary_search(sets.sets[heaviest].begin(), sets.sets[heaviest].end(), held);
        });
        *place = block;
        std::sort(blocks.begin(), blocks.end());
      }
    }
    add(std::move(blocks));
    CHECK(stays_.size() == before + 1);
  }
  if (stays_.empty()) add(nextStay(sets, wanted, settings.blocks, settings.resident));

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
  for (Stay& stay : stays_) {
    double weight = 0;
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      const bool there = missingFrom(stay.blocks, sets.sets[i]) == 0;
      stay.shareOfSet.push_back(there ? 1 / servings[i] : 0);
      if (there) weight += sets.weights[i] / servings[i];
    }
    const double begun = ended;
    ended += served > 0 ? weight / served : 1.0 / static_cast<double>(stays_.size());
    const double cycle = static_cast<double>(settings.cycleSteps);
    stay.steps = std::max<int64_t>(1, std::llround(ended * cycle) - std::llround(begun * cycle));
    cycleSteps_ += stay.steps;
  }
}

Residency::Place Residency::at(int64_t step) const {
  const int64_t cycle = step / cycleSteps_;
  std::vector<size_t> order(stays_.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const RandomStream random(settings_.seed, 0x5e51 + (static_cast<uint64_t>(cycle) << 16));
  for (size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[random.below(i, static_cast<uint32_t>(i))]);
  int64_t into = step % cycleSteps_;
  for (const size_t stay : order) {
    if (into < stays_[stay].steps) return {stay, into};
    into -= stays_[stay].steps;
  }
  CHECK(false);
  return {};
}

}  // namespace tessera
