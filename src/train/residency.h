// Schedules which blocks are resident at each step of a training that cannot keep all of them in memory (City-on-Web,
// section 4.1: a ray is trained only while all blocks that it crosses are resident). A cycle consists of resident sets
// of a few blocks each, such that every set of blocks that rays cross is resident together at least once. The number of
// steps of each resident set is proportional to the weight of the rays that it serves, divided among the resident sets
// that serve them. So, over a cycle, rays are drawn as evenly as if all blocks were in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

// The sets of blocks that rays cross together, and the number of rays (in any unit) that cross each.
struct BlockSets {
  std::vector<std::vector<uint32_t>> sets;  // increasing numbers
  std::vector<double> weights;              // [sets]
};

class Residency {
 public:
  struct Settings {
    uint32_t blocks = 1;    // in total
    uint32_t resident = 1;  // at a time, at most `blocks`
    int64_t cycleSteps = 1000;
    uint64_t seed = 0;
  };
  // Sets of more than `resident` blocks are never served. Of the others, the rarest ones, which make up kForgone of the
  // weight, are served only if they happen to fit, because each of them would need a resident set of its own; but for
  // each block the heaviest set that contains it and fits is always served.
  Residency(const BlockSets& sets, const Settings& settings);
  static constexpr double kForgone = 0.01;

  struct ResidentSet {
    std::vector<uint32_t> blocks;    // `resident` of them, increasing
    std::vector<double> shareOfSet;  // [sets], share of the set's rays to draw now; 0: not all its blocks are resident
    int64_t steps = 1;
  };
  // The resident sets of one cycle, in no particular order.
  const std::vector<ResidentSet>& residentSets() const { return residentSets_; }
  int64_t cycleSteps() const { return cycleSteps_; }  // sum of the steps of all resident sets, at least one each
  struct Position {
    size_t residentSet = 0;  // index
    int64_t stepsInto = 0;   // steps since it became resident
  };
  // Returns the resident set at a step, a function of step and seed: each cycle visits the resident sets in another
  // order.
  Position at(int64_t step) const;
  double unserved() const { return unserved_; }  // share of the total weight
  // Blocks that occur only in sets of more than `resident` blocks.
  const std::vector<uint32_t>& neverServed() const { return neverServed_; }

 private:
  Settings settings_;
  std::vector<ResidentSet> residentSets_;
  int64_t cycleSteps_ = 0;
  double unserved_ = 0;
  std::vector<uint32_t> neverServed_;
};

}  // namespace tessera
