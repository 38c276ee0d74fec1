// Blocks of a training that are not in memory: their parameters and moments, one file each, in a folder of their own.
// That is scratch: checkpoints hold the truth, and a resumed run fills it again.
#pragma once

#include <set>

#include "base/safetensors.h"

namespace tessera {

class WaitingBlocks {
 public:
  // Removes what is in `folder`, now and in the end.
  explicit WaitingBlocks(fs::path folder);
  ~WaitingBlocks();
  WaitingBlocks(const WaitingBlocks&) = delete;
  WaitingBlocks& operator=(const WaitingBlocks&) = delete;

  fs::path fileOf(uint32_t block) const;
  bool holds(uint32_t block) const { return held_.contains(block); }
  void put(uint32_t block, const Bytes& file);
  Safetensors get(uint32_t block) const { return readSafetensors(fileOf(block)); }

 private:
  fs::path folder_;
  std::set<uint32_t> held_;
};

}  // namespace tessera
