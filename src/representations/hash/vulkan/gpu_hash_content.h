// A `hash` content in GPU memory.
#pragma once

#include <array>
#include <vector>

#include "render/vulkan/gpu_content.h"
#include "representations/hash/content/hash_content.h"

namespace tessera {

// It takes no more GPU memory than the content from which it was made takes in main memory.
struct GpuHashContent final : GpuContent {
  GpuHashContent(const std::shared_ptr<GpuStream>& stream, const HashContent& content);

  uint64_t memoryBytes() const override { return memory.bytes(); }

  GpuContentMemory memory;
  LevelWeights weights = LevelWeights::separate;
  bool varies = false;  // the weights of levels vary from place to place; if not, they are `levelWeights`
  std::array<float, 2 * HashPart::kMaxTables> levelWeights = {};  // [tables][2]: of density and of all other features
  float step = 0;
  bool hasLearnedBackground = false;
  uint32_t partCount = 0, tables = 0, columns = 0;
  uint64_t parts = 0, vectors = 0;  // device addresses
  GpuNetwork network;
  std::vector<DenseLayer> layers;  // of the network, to recognise contents that share a network
};

}  // namespace tessera
