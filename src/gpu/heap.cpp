#include "gpu/heap.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/context.h"
#include "gpu/free_ranges.h"

namespace tessera {

namespace {

constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;

struct Kind {
  VkMemoryPropertyFlags wanted, preferred;
};

Kind kindOf(BufferUse use) {
  switch (use) {
    case BufferUse::upload:
      return {kHost, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
    case BufferUse::download:
      return {kHost, VK_MEMORY_PROPERTY_HOST_CACHED_BIT};
    default:
      return {0, VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT};
  }
}

size_t indexOf(BufferUse use) {
  return static_cast<size_t>(use);
}

}  // namespace

struct GpuHeap::Block {
  Block(VkDevice itsDevice, size_t bytes, BufferUse itsUse) : device(itsDevice), use(itsUse), free(bytes) {}
  ~Block() {
    if (buffer) vkDestroyBuffer(device, buffer, nullptr);
    if (memory) vkFreeMemory(device, memory, nullptr);  // unmaps
  }
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  VkDevice device;
  BufferUse use;
  FreeRanges free;
  bool shared = false;  // by several pieces
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceMemory memory = VK_NULL_HANDLE;
  VkDeviceAddress address = 0;
  std::byte* mapped = nullptr;
};

GpuHeap::GpuHeap(const GpuContext& context) : context_(context) {}
GpuHeap::~GpuHeap() = default;

std::unique_ptr<GpuHeap::Block> GpuHeap::makeBlock(size_t bytes, BufferUse use) const {
  const VkDevice device = context_.device();
  auto block = std::make_unique<Block>(device, bytes, use);
  auto info = vulkanStruct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.size = bytes;
  info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
               VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT |
               VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
  std::string wanted = fmt::format("{} MiB more, with {} MiB in use", bytes >> 20, inUse_ >> 20);
  if (bytes > context_.largestAllocation()) {  // drivers may give more than they promise
    wanted += fmt::format("; the driver promises {} MiB at once", context_.largestAllocation() >> 20);
  }
  checkVulkan(vkCreateBuffer(device, &info, nullptr, &block->buffer), wanted.c_str());

  VkMemoryRequirements needs = {};
  vkGetBufferMemoryRequirements(device, block->buffer, &needs);
  auto flags = vulkanStruct<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
  flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
  auto allocation = vulkanStruct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  allocation.pNext = &flags;
  allocation.allocationSize = needs.size;
  const Kind kind = kindOf(use);
  allocation.memoryTypeIndex = context_.memoryType(needs.memoryTypeBits, kind.wanted, kind.preferred);
  VkResult result = vkAllocateMemory(device, &allocation, nullptr, &block->memory);
  // What the host writes may lie with the host. What kernels of a card work on may not: many times slower, and nobody
  // would know why.
  const bool mayLieElsewhere = use != BufferUse::device || !context_.isDiscrete();
  const uint32_t others = needs.memoryTypeBits & ~context_.typesOfSameHeap(allocation.memoryTypeIndex);
  const std::optional<uint32_t> elsewhere = context_.findMemoryType(others, kind.wanted);
  if (result == VK_ERROR_OUT_OF_DEVICE_MEMORY && mayLieElsewhere && elsewhere) {
    allocation.memoryTypeIndex = *elsewhere;
    result = vkAllocateMemory(device, &allocation, nullptr, &block->memory);
  }
  checkVulkan(result, wanted.c_str());
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

GpuHeap::Piece GpuHeap::allocate(size_t bytes, BufferUse use) {
  CHECK(bytes > 0u);
  const std::lock_guard lock(mutex_);
  const size_t room = (bytes + kAlignment - 1) / kAlignment * kAlignment;
  const bool shared = room <= kBlockBytes / 2;
  auto& blocks = blocks_[indexOf(use)];
  Block* chosen = nullptr;
  std::optional<size_t> offset;
  for (size_t i = 0; shared && i < blocks.size() && !offset; ++i) {
    if (!blocks[i]->shared) continue;
    chosen = blocks[i].get();
    offset = chosen->free.take(room);
  }
  if (!offset) {
    blocks.push_back(makeBlock(shared ? kBlockBytes : room, use));
    chosen = blocks.back().get();
    chosen->shared = shared;
    offset = chosen->free.take(room);
  }
  inUse_ += room;
  return {
      chosen, chosen->buffer, *offset, chosen->address + *offset, chosen->mapped ? chosen->mapped + *offset : nullptr,
      room};
}

void GpuHeap::free(const Piece& piece) {
  const std::lock_guard lock(mutex_);
  Block& block = *piece.block;
  block.free.giveBack(piece.offset, piece.room);
  inUse_ -= piece.room;
  if (!block.free.allFree()) return;
  // One empty block of a kind waits for the next piece.
  auto& blocks = blocks_[indexOf(block.use)];
  const bool another = std::any_of(blocks.begin(), blocks.end(), [&](const std::unique_ptr<Block>& other) {
    return other.get() != &block && other->shared && other->free.allFree();
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
