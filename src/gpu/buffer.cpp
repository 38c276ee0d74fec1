#include "gpu/buffer.h"

#include <fmt/format.h>

#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"

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

}  // namespace

GpuBuffer::GpuBuffer(std::shared_ptr<const GpuContext> context, size_t bytes, BufferUse use)
    : context_(std::move(context)), bytes_(bytes) {
  CHECK(bytes != 0u);
  const VkDevice device = context_->device();
  try {
    auto info = vulkanStruct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
    info.size = (bytes + 3) / 4 * 4;  // fills work on whole words
    info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                 VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    checkVulkan(vkCreateBuffer(device, &info, nullptr, &buffer_), "vkCreateBuffer");

    VkMemoryRequirements needs = {};
    vkGetBufferMemoryRequirements(device, buffer_, &needs);
    auto flags = vulkanStruct<VkMemoryAllocateFlagsInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_FLAGS_INFO);
    flags.flags = VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT;
    auto allocation = vulkanStruct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
    allocation.pNext = &flags;
    allocation.allocationSize = needs.size;
    const Kind kind = kindOf(use);
    allocation.memoryTypeIndex = context_->memoryType(needs.memoryTypeBits, kind.wanted, kind.preferred);
    checkVulkan(vkAllocateMemory(device, &allocation, nullptr, &memory_),
                fmt::format("vkAllocateMemory of {} MiB", needs.size >> 20).c_str());
    checkVulkan(vkBindBufferMemory(device, buffer_, memory_, 0), "vkBindBufferMemory");

    if (use != BufferUse::device) {
      void* pointer = nullptr;
      checkVulkan(vkMapMemory(device, memory_, 0, VK_WHOLE_SIZE, 0, &pointer), "vkMapMemory");
      mapped_ = static_cast<std::byte*>(pointer);
    }
    auto addressInfo = vulkanStruct<VkBufferDeviceAddressInfo>(VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO);
    addressInfo.buffer = buffer_;
    address_ = vkGetBufferDeviceAddress(device, &addressInfo);
  } catch (...) {
    destroy();
    throw;
  }
}

GpuBuffer& GpuBuffer::operator=(GpuBuffer&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(buffer_, other.buffer_);
  std::swap(memory_, other.memory_);
  std::swap(address_, other.address_);
  std::swap(bytes_, other.bytes_);
  std::swap(mapped_, other.mapped_);
  return *this;
}

void GpuBuffer::destroy() {
  if (buffer_) vkDestroyBuffer(context_->device(), buffer_, nullptr);
  if (memory_) vkFreeMemory(context_->device(), memory_, nullptr);  // unmaps
  buffer_ = VK_NULL_HANDLE;
  memory_ = VK_NULL_HANDLE;
}

}  // namespace tessera
