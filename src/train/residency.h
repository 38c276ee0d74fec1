// Which blocks are in memory at which step of a training that cannot hold them all (City-on-Web, section 4.1: a ray is
// trained only while all that it sees is there). A cycle of stays, each with a few blocks, in which every set of blocks
// that rays go through is together at least once; stays last as long as the rays that only they and few others serve
// deserve. So, over a cycle, rays are drawn as evenly as if all blocks were in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

// What rays go through: sets of blocks, and how many rays (in any unit) see each.
struct BlockSets {
  std::vector<std::vector<uint32_t>> sets;  // increasing numbers
  std::vector<double> weights;              // [sets]
};

class Residency {
 public:
  struct Settings {
    uint32_t blocks = 1;    // in all
    uint32_t resident = 1;  // at once, at most `blocks`
    int64_t cycleSteps = 1000;
    uint64_t seed = 0;
  };
  // Sets of more blocks than may be in memory are never served; nor, unless it happens to fit, is the rarest of the
  // rest, kForgone of the weight: each would ask for a stay of its own. But the heaviest with each block always is.
  Residency(const BlockSets& sets, const Settings& settings);
  static constexpr double kForgone = 0.01;

  struct Stay {
    std::vector<uint32_t> blocks;    // `resident` of them, increasing
    std::vector<double> shareOfSet;  // [sets]: of the rays to draw, for each of its weight; 0: not all there
    int64_t steps = 1;
  };
  const std::vector<Stay>& stays() const { return stays_; }  // of one cycle, in no particular order
  int64_t cycleSteps() const { return cycleSteps_; }         // at least one step a stay
  // A function of step and seed: each cycle has the stays in another order.
  struct Place {
    size_t stay = 0;
    int64_t stepsInto = 0;
  };
  Place at(int64_t step) const;
  double unserved() const { return unserved_; }                              // share of the weight
  const std::vector<uint32_t>& neverServed() const { return neverServed_; }  // blocks of sets that are all too large

 private:
  Settings settings_;
  std::vector<Stay> stays_;
  int64_t cycleSteps_ = 0;
  double unserved_ = 0;
  std::vector<uint32_t> neverServed_;
};

}  // namespace tessera
