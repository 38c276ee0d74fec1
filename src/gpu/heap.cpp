#include "gpu/heap.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/context.h"
#include "gpu/free_ranges.h"

namespace tessera {

namespace {

constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

struct Kind {
  VkMemoryPropertyFlags required, preferred;
};

Kind memoryKind(BufferUse use) {
  switch (use) {
    case BufferUse::upload:
      return {kHost, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
    case BufferUse::download:
      return {kHost, VK_MEMORY_PROPERTY_HOST_CACHED_BIT};
    default:
      return {0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
  }
}

size_t bufferUseIndex(BufferUse use) {
  return static_cast<size_t>(use);
}
constexpr size_t kImages = 3;  // the index of the list of image blocks

size_t roundedUp(size_t bytes, size_t alignment) {
  return (bytes + alignment - 1) / alignment * alignment;
}

// Describes a request for error messages.
std::string describeRequest(size_t bytes, size_t inUse, const GpuContext& context) {
  std::string description = fmt::format("{} MiB more, with {} MiB in use", bytes >> 20, inUse >> 20);
  if (bytes > context.largestAllocation()) {  // drivers may allocate more than they guarantee
    description += fmt::format("; the driver guarantees {} MiB per allocation", context.largestAllocation() >> 20);
  }
  return description;
}

}  // namespace

struct GpuHeap::Block {
  Block(VkDevice itsDevice, size_t itsBytes, size_t itsList)
      : device(itsDevice), bytes(itsBytes), list(itsList), free(itsBytes) {}
  ~Block() {
    if (buffer) vkDestroyBuffer(device, buffer, nullptr);
    if (memory) vkFreeMemory(device, memory, nullptr);  // unmaps
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  VkDevice device;
  size_t bytes;
  size_t list;  // the index of its list in GpuHeap::blocks_
  FreeRanges free;
  bool shared = false;  // can hold several pieces
  uint32_t memoryType = 0;
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  VkDeviceAddress address = 0;
  std::byte* mapped = nullptr;
};

GpuHeap::GpuHeap(const GpuContext& context) : context_(context) {}
GpuHeap::~GpuHeap() = default;

void GpuHeap::allocateMemory(Block& block, const VkMemoryRequirements& needs, BufferUse use, const void* next) const {
  auto allocation = vulkanStruct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  allocation.pNext = next;
  allocation.allocationSize = needs.size;
  const Kind kind = memoryKind(use);
  allocation.memoryTypeIndex = context_.memoryType(needs.memoryTypeBits, kind.required, kind.preferred);
  VkResult result = vkAllocateMemory(block.device, &allocation, nullptr, &block.memory);
  // Upload and download buffers may fall back to host memory. Buffers of a discrete GPU's kernels may not: they would
  // be many times slower for no visible reason.
  const bool mayLieElsewhere = use != BufferUse::device || !context_.isDiscrete();
  const uint32_t others = needs.memoryTypeBits & ~context_.typesOfSameHeap(allocation.memoryTypeIndex);
  const std::optional<uint32_t> elsewhere = context_.findMemoryType(others, kind.required);
  if (result == VK_ERROR_OUT_OF_DEVICE_MEMORY && mayLieElsewhere && elsewhere) {
    allocation.memoryTypeIndex = *elsewhere;
    result = vkAllocateMemory(block.device, &allocation, nullptr, &block.memory);
  }
  checkVulkan(result, describeRequest(block.bytes, inUse_, context_).c_str());
  block.memoryType = allocation.memoryTypeIndex;
}

std::unique_ptr<GpuHeap::Block> GpuHeap::makeBufferBlock(size_t bytes, BufferUse use) const {
  const VkDevice device = context_.device();
  auto block = std::make_unique<Block>(device, bytes, bufferUseIndex(use));
  auto info = vulkanStruct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.size = bytes;
  info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
               VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
               VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
  checkVulkan(vkCreateBuffer(device, &info, nullptr, &block->buffer), describeRequest(bytes, inUse_, context_).c_str());

  VkMemoryRequirements needs = {};
  vkGetBufferMemoryRequirements(device, block->buffer, &needs);
  auto flags = vulkanStruct<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  allocateMemory(*block, needs, use, &flags);
  checkVulkan(vkBindBufferMemory(device, block->buffer, block->memory, 0), "vkBindBufferMemory");
  if (use != BufferUse::device) {
    void* pointer = nullptr;
    checkVulkan(vkMapMemory(device, block->memory, 0, VK_WHOLE_SIZE, 0, &pointer), "vkMapMemory");
    block->mapped = static_cast<std::byte*>(pointer);
  }
  auto addressInfo = vulkanStruct<VkBufferDeviceAddressInfo>(VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO);
  addressInfo.buffer = block->buffer;
  block->address = vkGetBufferDeviceAddress(device, &addressInfo);
  return block;
}

std::unique_ptr<GpuHeap::Block> GpuHeap::makeImageBlock(const VkMemoryRequirements& needs) const {
  auto block = std::make_unique<Block>(context_.device(), needs.size, kImages);
  allocateMemory(*block, needs, BufferUse::device, nullptr);
  return block;
}

GpuHeap::Piece GpuHeap::allocate(size_t bytes, BufferUse use) {
  CHECK(bytes > 0u);
  const std::lock_guard lock(mutex_);
  return take(blocks_[bufferUseIndex(use)], {roundedUp(bytes, kAlignment)},
              [&](size_t blockBytes) { return makeBufferBlock(blockBytes, use); });
}

GpuHeap::Piece GpuHeap::allocateImage(VkImage image) {
  VkMemoryRequirements needs = {};
  vkGetImageMemoryRequirements(context_.device(), image, &needs);
  const std::lock_guard lock(mutex_);
  // Pieces whose sizes are multiples of kImageAlignment are aligned to it. An image with a larger alignment gets its
  // own block.
  const Request request = {roundedUp(needs.size, kImageAlignment), needs.memoryTypeBits,
                           needs.alignment <= kImageAlignment};
  return take(blocks_[kImages], request, [&](size_t blockBytes) {
    needs.size = blockBytes;
    return makeImageBlock(needs);
  });
}

GpuHeap::Piece GpuHeap::take(Blocks& blocks, const Request& request, const MakeBlock& make) {
  const size_t capacity = request.capacity;
  bool shared = request.mayShare && capacity <= kBlockBytes / 2;
  Block* chosen = nullptr;
  std::optional<size_t> offset;
  for (size_t i = 0; shared && i < blocks.size() && !offset; ++i) {
    if (!blocks[i]->shared || (request.typeBits >> blocks[i]->memoryType & 1) == 0) continue;
    chosen = blocks[i].get();
    offset = chosen->free.take(capacity);
  }
  if (!offset) {
    try {
      blocks.push_back(make(shared ? kBlockBytes : capacity));
    } catch (const Error&) {
      if (!shared) throw;
      shared = false;  // there may be memory for this piece alone
      blocks.push_back(make(capacity));
    }
    chosen = blocks.back().get();
    chosen->shared = shared;
    offset = chosen->free.take(capacity);
  }
  inUse_ += capacity;
  Piece piece;
  piece.block = chosen;
  piece.buffer = chosen->buffer;
  piece.offset = *offset;
  piece.address = chosen->buffer ? chosen->address + *offset : 0;
  piece.mapped = chosen->mapped ? chosen->mapped + *offset : nullptr;
  piece.capacity = capacity;
  piece.memory = chosen->memory;
  return piece;
}

void GpuHeap::free(const Piece& piece) {
  const std::lock_guard lock(mutex_);
  Block& block = *piece.block;
  block.free.giveBack(piece.offset, piece.capacity);
  inUse_ -= piece.capacity;
  if (!block.free.allFree()) return;
  // One empty block of each kind is kept for the next piece.
  auto& blocks = blocks_[block.list];
  const auto isAlike = [&](const Block& other) {
    return block.list != kImages || other.memoryType == block.memoryType;
  };
  const bool another = std::any_of(blocks.begin(), blocks.end(), [&](const std::unique_ptr<Block>& other) {
    return other.get() != &block && other->shared && isAlike(*other) && other->free.allFree();
  });
  if (block.shared && !another) return;
  ++generation_;
  std::erase_if(blocks, [&](const std::unique_ptr<Block>& other) { return other.get() == &block; });
}

size_t GpuHeap::bytesInUse() const {
  const std::lock_guard lock(mutex_);
  return inUse_;
}

uint64_t GpuHeap::generation() const {
  const std::lock_guard lock(mutex_);
  return generation_;
}

size_t GpuHeap::blockCount() const {
  const std::lock_guard lock(mutex_);
  size_t count = 0;
  for (const auto& blocks : blocks_) count += blocks.size();
  return count;
}

}  // namespace tessera
