#include "gpu/stream.h"

#include <algorithm>
#include <cstring>

#include "base/check.h"
#include "gpu/call.h"

namespace tessera {

namespace {

constexpr size_t kAlignment = 64;       // of staged bytes; more than any argument struct needs
constexpr int kCommandsPerBatch = 128;  // enough to amortise a submission, few enough to start the device early

}  // namespace

GpuStream::GpuStream(std::shared_ptr<const GpuContext> context, size_t stagingBytes)
    : context_(std::move(context)), stagingBytes_(stagingBytes / kAlignment * kAlignment) {
  CHECK(size_t{0} < stagingBytes_);
  auto poolInfo = vulkanStruct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  poolInfo.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  poolInfo.queueFamilyIndex = context_->queueFamily();
  checkVulkan(vkCreateCommandPool(context_->device(), &poolInfo, nullptr, &pool_), "vkCreateCommandPool");
  for (Batch& batch : batches_) {
    auto info = vulkanStruct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    info.commandPool = pool_;
    info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    info.commandBufferCount = 1;
    checkVulkan(vkAllocateCommandBuffers(context_->device(), &info, &batch.commands), "vkAllocateCommandBuffers");
    auto fenceInfo = vulkanStruct<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
    checkVulkan(vkCreateFence(context_->device(), &fenceInfo, nullptr, &batch.done), "vkCreateFence");
    batch.staging = GpuBuffer(context_, stagingBytes_, BufferUse::upload);
  }
  begin();
}

GpuStream::~GpuStream() {
  for (Batch& batch : batches_) {
    if (batch.submitted) vkWaitForFences(context_->device(), 1, &batch.done, VK_TRUE, UINT64_MAX);
  }
  for (Batch& batch : batches_) vkDestroyFence(context_->device(), batch.done, nullptr);
  vkDestroyCommandPool(context_->device(), pool_, nullptr);
}

void GpuStream::begin() {
  Batch& batch = recording();
  auto info = vulkanStruct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  checkVulkan(vkBeginCommandBuffer(batch.commands, &info), "vkBeginCommandBuffer");
  batch.staged = 0;
  batch.recorded = 0;
}

void GpuStream::submit() {
  Batch& batch = recording();
  checkVulkan(vkEndCommandBuffer(batch.commands), "vkEndCommandBuffer");
  auto info = vulkanStruct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  info.commandBufferCount = 1;
  info.pCommandBuffers = &batch.commands;
  checkVulkan(vkQueueSubmit(context_->queue(), 1, &info, batch.done), "vkQueueSubmit");
  batch.submitted = true;
  current_ = 1 - current_;
  wait(recording());
  begin();
}

void GpuStream::wait(Batch& batch) {
  if (!batch.submitted) return;
  checkVulkan(vkWaitForFences(context_->device(), 1, &batch.done, VK_TRUE, UINT64_MAX), "vkWaitForFences");
  checkVulkan(vkResetFences(context_->device(), 1, &batch.done), "vkResetFences");
  batch.submitted = false;
  batch.retired.clear();
}

void GpuStream::finish() {
  if (recording().recorded > 0 || !recording().retired.empty()) submit();
  for (Batch& batch : batches_) wait(batch);
}

void GpuStream::beforeCommand() {
  if (recording().recorded >= kCommandsPerBatch) submit();
  ++recording().recorded;
  // A barrier reaches back over all batches sent before, too: they are on one queue.
  auto barrier = vulkanStruct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_READ_BIT |
                          VK_ACCESS_TRANSFER_WRITE_BIT;
  constexpr VkPipelineStageFlags kStages = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
  vkCmdPipelineBarrier(recording().commands, kStages, kStages, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

size_t GpuStream::stage(std::span<const std::byte> bytes) {
  Batch& batch = recording();
  const size_t offset = batch.staged;
  CHECK(bytes.size() <= stagingBytes_ - offset);
  std::memcpy(batch.staging.mapped() + offset, bytes.data(), bytes.size());
  batch.staged += (bytes.size() + kAlignment - 1) / kAlignment * kAlignment;
  return offset;
}

void GpuStream::upload(const GpuBuffer& to, size_t offset, std::span<const std::byte> bytes) {
  CHECK(offset + bytes.size() <= to.bytes());
  while (!bytes.empty()) {
    if (recording().staged == stagingBytes_) submit();
    beforeCommand();
    const size_t length = std::min(bytes.size(), stagingBytes_ - recording().staged);
    const VkBufferCopy copy = {stage(bytes.first(length)), offset, length};
    vkCmdCopyBuffer(recording().commands, recording().staging.handle(), to.handle(), 1, &copy);
    bytes = bytes.subspan(length);
    offset += length;
  }
}

void GpuStream::download(const GpuBuffer& from, size_t offset, std::span<std::byte> bytes) {
  CHECK(offset + bytes.size() <= from.bytes());
  if (!downloads_ && !bytes.empty()) downloads_ = GpuBuffer(context_, stagingBytes_, BufferUse::download);
  while (!bytes.empty()) {
    const size_t length = std::min(bytes.size(), stagingBytes_);
    beforeCommand();
    const VkBufferCopy copy = {offset, 0, length};
    vkCmdCopyBuffer(recording().commands, from.handle(), downloads_.handle(), 1, &copy);
    auto barrier = vulkanStruct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
    barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
    barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
    vkCmdPipelineBarrier(recording().commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1,
                         &barrier, 0, nullptr, 0, nullptr);
    finish();
    std::memcpy(bytes.data(), downloads_.mapped(), length);
    bytes = bytes.subspan(length);
    offset += length;
  }
}

void GpuStream::fillZero(const GpuBuffer& buffer, size_t offset, size_t bytes) {
  CHECK(offset % 4 == 0u);
  CHECK(bytes % 4 == 0u);
  if (bytes == 0) return;
  beforeCommand();
  vkCmdFillBuffer(recording().commands, buffer.handle(), offset, bytes, 0);
}

void GpuStream::run(const GpuKernel& kernel, std::span<const std::byte> arguments, Groups groups) {
  if (groups.x == 0 || groups.y == 0 || groups.z == 0) return;
  CHECK(arguments.size() <= stagingBytes_);
  CHECK(groups.x <= context_->limits().maxComputeWorkGroupCount[0]);
  CHECK(groups.y <= context_->limits().maxComputeWorkGroupCount[1]);
  CHECK(groups.z <= context_->limits().maxComputeWorkGroupCount[2]);
  if (stagingBytes_ - recording().staged < arguments.size()) submit();
  beforeCommand();
  const VkDeviceAddress address = recording().staging.address() + stage(arguments);
  const VkCommandBuffer commands = recording().commands;
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, kernel.pipeline());
  vkCmdPushConstants(commands, kernel.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof address, &address);
  vkCmdDispatch(commands, groups.x, groups.y, groups.z);
}

void GpuStream::retire(GpuBuffer buffer) {
  if (buffer) recording().retired.push_back(std::move(buffer));
}

}  // namespace tessera
