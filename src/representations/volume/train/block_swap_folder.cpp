#include "representations/volume/train/block_swap_folder.h"

#include <system_error>

namespace tessera {

BlockSwapFolder::BlockSwapFolder(fs::path folder) : folder_(std::move(folder)) {
  fs::remove_all(folder_);
}

BlockSwapFolder::~BlockSwapFolder() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

fs::path BlockSwapFolder::blockFile(uint32_t block) const {
  return folder_ / (std::to_string(block) + ".safetensors");
}

void BlockSwapFolder::put(uint32_t block, const Bytes& file) {
  writeFileAtomically(blockFile(block), file);
  swappedOut_.insert(block);
}

}  // namespace tessera
