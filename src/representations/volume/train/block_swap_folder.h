// Stores the blocks of a training run that are not in memory: their parameters and moments, one file per block, in a
// folder of their own. The folder is scratch space: checkpoints are authoritative, and a resumed run fills it again.
#pragma once

#include <set>

#include "base/safetensors.h"

namespace tessera {

class BlockSwapFolder {
 public:
  // Removes the contents of `folder`, both now and on destruction.
  explicit BlockSwapFolder(fs::path folder);
  ~BlockSwapFolder();
  BlockSwapFolder(const BlockSwapFolder&) = delete;
  BlockSwapFolder& operator=(const BlockSwapFolder&) = delete;

  fs::path blockFile(uint32_t block) const;
  bool holds(uint32_t block) const { return swappedOut_.contains(block); }
  // Write and read the file of a block. Throw Error if it cannot be written, read or decoded.
  void put(uint32_t block, const Bytes& file);
  Safetensors get(uint32_t block) const { return readSafetensors(blockFile(block)); }

 private:
  fs::path folder_;
  std::set<uint32_t> swappedOut_;
};

}  // namespace tessera
