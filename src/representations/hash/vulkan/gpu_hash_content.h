// A content of `hash` on a GPU.
#pragma once

#include <array>
#include <vector>

#include "render/vulkan/gpu_content.h"
#include "representations/hash/content/hash_content.h"

namespace tessera {

// It takes no more of the GPU than the content that it is made of takes in memory.
struct GpuHashContent final : GpuContent {
  GpuHashContent(const std::shared_ptr<GpuStream>& stream, const HashContent& content);

  uint64_t memoryBytes() const override { return memory.bytes(); }

  GpuContentMemory memory;
  LevelWeights weights = LevelWeights::separate;
  bool varies = false;  // from place to place; else `levelWeights` are those of density and of all else
  std::array<float, 2 * HashPart::kMostTables> levelWeights = {};
  float step = 0;
  bool isWhole = false;
  uint32_t partCount = 0, tables = 0, columns = 0;
  uint64_t parts = 0, vectors = 0;  // addresses
  GpuNetwork network;
  std::vector<DenseLayer> layers;  // of the network: contents with the same numbers have the same one
};

}  // namespace tessera
