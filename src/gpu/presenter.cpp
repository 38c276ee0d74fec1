#include "gpu/presenter.h"

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "gpu/call.h"

namespace tessera {

namespace {

constexpr size_t kStagingBytes = size_t{1} << 20;
constexpr size_t kAlignment = 16;
constexpr VkPipelineStageFlags kWrites = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
constexpr VkPipelineStageFlags kReads = VK_PIPELINE_STAGE_VERTEX_SHADER_BIT | VK_PIPELINE_STAGE_FRAGMENT_SHADER_BIT;

}  // namespace

GpuPresenter::GpuPresenter(std::shared_ptr<const GpuContext> context, VkSurfaceKHR surface)
    : context_(std::move(context)), swapchain_(context_, surface) {
  const VkDevice device = context_->device();
  auto pool = vulkanStruct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool.queueFamilyIndex = context_->queueFamily();
  checkVulkan(vkCreateCommandPool(device, &pool, nullptr, &pool_), "vkCreateCommandPool");
  for (Frame& frame : frames_) {
    auto commands = vulkanStruct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
    commands.commandPool = pool_;
    commands.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
    commands.commandBufferCount = 1;
    checkVulkan(vkAllocateCommandBuffers(device, &commands, &frame.commands), "vkAllocateCommandBuffers");
    const auto semaphore = vulkanStruct<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO);
    checkVulkan(vkCreateSemaphore(device, &semaphore, nullptr, &frame.available), "vkCreateSemaphore");
    auto fence = vulkanStruct<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
    fence.flags = VK_FENCE_CREATE_SIGNALED_BIT;
    checkVulkan(vkCreateFence(device, &fence, nullptr, &frame.drawn), "vkCreateFence");
  }
}

GpuPresenter::~GpuPresenter() {
  const VkDevice device = context_->device();
  vkDeviceWaitIdle(device);
  for (const Frame& frame : frames_) {
    vkDestroyFence(device, frame.drawn, nullptr);
    vkDestroySemaphore(device, frame.available, nullptr);
  }
  vkDestroyCommandPool(device, pool_, nullptr);
}

bool GpuPresenter::begin(VkExtent2D window) {
  const bool isSame = window.width == window_.width && window.height == window_.height;
  if (!swapchain_.isMade() || !fits_ || !isSame) {
    window_ = window;
    fits_ = window.width > 0 && window.height > 0 && swapchain_.remake(window);
    if (!fits_) return false;
  }
  Frame& frame = frames_[current_];
  checkVulkan(vkWaitForFences(context_->device(), 1, &frame.drawn, VK_TRUE, UINT64_MAX), "vkWaitForFences");
  const GpuSwapchain::Acquired acquired = swapchain_.acquire(frame.available, image_);
  fits_ = acquired != GpuSwapchain::Acquired::fitsNoMore;
  if (acquired != GpuSwapchain::Acquired::image) return false;
  checkVulkan(vkResetFences(context_->device(), 1, &frame.drawn), "vkResetFences");
  frame.buffer = frame.staged = 0;

  auto info = vulkanStruct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  checkVulkan(vkBeginCommandBuffer(frame.commands, &info), "vkBeginCommandBuffer");
  auto computed = vulkanStruct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  computed.srcAccessMask = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
  computed.dstAccessMask = VK_ACCESS_SHADER_READ_BIT;
  vkCmdPipelineBarrier(frame.commands, kWrites, kReads, 0, 1, &computed, 0, nullptr, 0, nullptr);
  const VkClearValue black = {{{0, 0, 0, 1}}};
  auto pass = vulkanStruct<VkRenderPassBeginInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO);
  pass.renderPass = swapchain_.renderPass();
  pass.framebuffer = swapchain_.image(image_).framebuffer;
  pass.renderArea.extent = extent();
  pass.clearValueCount = 1;
  pass.pClearValues = &black;
  vkCmdBeginRenderPass(frame.commands, &pass, VK_SUBPASS_CONTENTS_INLINE);
  const VkViewport viewport = {
      0, 0, static_cast<float>(extent().width), static_cast<float>(extent().height), 0, 1,
  };
  vkCmdSetViewport(frame.commands, 0, 1, &viewport);
  return true;
}

VkDeviceAddress GpuPresenter::stage(std::span<const std::byte> bytes) {
  Frame& frame = frames_[current_];
  const auto fits = [&] {
    return frame.buffer < frame.staging.size() && frame.staged + bytes.size() <= frame.staging[frame.buffer].bytes();
  };
  while (!fits() && frame.buffer < frame.staging.size()) {
    ++frame.buffer;
    frame.staged = 0;
  }
  if (!fits()) frame.staging.emplace_back(context_, std::max(kStagingBytes, bytes.size()), BufferUse::upload);
  const GpuBuffer& buffer = frame.staging[frame.buffer];
  const size_t offset = frame.staged;
  std::memcpy(buffer.mapped() + offset, bytes.data(), bytes.size());
  frame.staged += (bytes.size() + kAlignment - 1) / kAlignment * kAlignment;
  return buffer.address() + offset;
}

void GpuPresenter::draw(const GpuScreenPipeline& pipeline, std::span<const std::byte> arguments, uint32_t vertices,
                        const VkRect2D& where) {
  const VkCommandBuffer commands = frames_[current_].commands;
  const VkDeviceAddress address = stage(arguments);
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline.pipeline());
  vkCmdPushConstants(commands, pipeline.layout(), GpuScreenPipeline::kStages, 0, sizeof address, &address);
  vkCmdSetScissor(commands, 0, 1, &where);
  vkCmdDraw(commands, vertices, 1, 0, 0);
}

// Copies the image to a buffer and leaves it in the layout for presentation.
void GpuPresenter::read(const GpuSwapchain::Image& image, const GpuBuffer& to) {
  const VkCommandBuffer commands = frames_[current_].commands;
  auto turn = vulkanStruct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
  turn.image = image.image;
  turn.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
  turn.srcQueueFamilyIndex = turn.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  turn.srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  turn.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
  turn.oldLayout = VK_IMAGE_LAYOUT_PRESENT_SRC_KHR;
  turn.newLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT,
                       VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr, 0, nullptr, 1, &turn);
  VkBufferImageCopy copy = {};
  copy.bufferOffset = to.offset();
  copy.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  copy.imageExtent = {extent().width, extent().height, 1};
  vkCmdCopyImageToBuffer(commands, image.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to.handle(), 1, &copy);
  auto copied = vulkanStruct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  copied.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  copied.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &copied, 0, nullptr,
                       0, nullptr);
  turn.srcAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
  turn.dstAccessMask = 0;
  std::swap(turn.oldLayout, turn.newLayout);
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, 0, 0, nullptr, 0,
                       nullptr, 1, &turn);
}

void GpuPresenter::end(ImageU8* screenshot) {
  Frame& frame = frames_[current_];
  const GpuSwapchain::Image& image = swapchain_.image(image_);
  vkCmdEndRenderPass(frame.commands);
  GpuBuffer copied;
  if (screenshot) {
    if (!swapchain_.canBeRead()) {
      throw Error(context_->name(), "", "images of this screen cannot be read back", "do without a screenshot");
    }
    copied = GpuBuffer(context_, size_t{4} * extent().width * extent().height, BufferUse::download);
    read(image, copied);
  }
  // Later commands may overwrite what this frame has read.
  auto readAll = vulkanStruct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  vkCmdPipelineBarrier(frame.commands, kReads, kWrites, 0, 1, &readAll, 0, nullptr, 0, nullptr);
  checkVulkan(vkEndCommandBuffer(frame.commands), "vkEndCommandBuffer");

  const VkPipelineStageFlags drawing = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  auto info = vulkanStruct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  info.waitSemaphoreCount = 1;
  info.pWaitSemaphores = &frame.available;
  info.pWaitDstStageMask = &drawing;
  info.commandBufferCount = 1;
  info.pCommandBuffers = &frame.commands;
  info.signalSemaphoreCount = 1;
  info.pSignalSemaphores = &image.drawn;
  checkVulkan(vkQueueSubmit(context_->queue(), 1, &info, frame.drawn), "vkQueueSubmit");
  if (screenshot) {
    checkVulkan(vkWaitForFences(context_->device(), 1, &frame.drawn, VK_TRUE, UINT64_MAX), "vkWaitForFences");
    *screenshot = ImageU8(static_cast<int>(extent().width), static_cast<int>(extent().height), 3);
    const bool blueFirst = swapchain_.isBlueFirst();
    for (size_t p = 0; p < screenshot->pixelCount(); ++p) {
      for (size_t c = 0; c < 3; ++c) {
        screenshot->pixels[3 * p + c] = static_cast<uint8_t>(copied.mapped()[4 * p + (blueFirst ? 2 - c : c)]);
      }
    }
  }
  fits_ = swapchain_.present(image_);
  current_ = 1 - current_;
}

}  // namespace tessera
