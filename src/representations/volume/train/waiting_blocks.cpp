#include "representations/volume/train/waiting_blocks.h"

#include <system_error>

namespace tessera {

WaitingBlocks::WaitingBlocks(fs::path folder) : folder_(std::move(folder)) {
  fs::remove_all(folder_);
}

WaitingBlocks::~WaitingBlocks() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

fs::path WaitingBlocks::fileOf(uint32_t block) const {
  return folder_ / (std::to_string(block) + ".safetensors");
}

void WaitingBlocks::put(uint32_t block, const Bytes& file) {
  writeFileAtomically(fileOf(block), file);
  held_.insert(block);
}

}  // namespace tessera
