// The image commands of a stream: render passes, and copies to and from buffers. Every command leaves images in
// GpuImage::kRestingLayout and none depends on the commands before it, so each is valid in a resubmitted batch.
#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/stream.h"

namespace tessera {

namespace {

void changeLayout(VkCommandBuffer commands, const GpuImage& image, VkImageLayout from, VkImageLayout to) {
  auto barrier = vulkanStruct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.oldLayout = from;
  barrier.newLayout = to;
  barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image.handle();
  barrier.subresourceRange = {image.aspect(), 0, 1, 0, 1};
  vkCmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0, nullptr, 0,
                       nullptr, 1, &barrier);
}

void checkCopy(const GpuImage& image, const GpuBuffer& buffer, size_t offset) {
  CHECK(offset % 4 == 0u);
  CHECK(offset % bytesPerPixel(image.format()) == 0u);
  CHECK(offset + image.copiedBytes() <= buffer.bytes());
}

}  // namespace

void GpuStream::draw(const GpuRenderPass& pass, std::span<const DrawCall> draws) {
  size_t argumentBytes = 0;
  for (const DrawCall& draw : draws) {
    CHECK((draw.pipeline->formats() == pass.formats()));
    argumentBytes += roundedUp(draw.arguments.size());
  }
  CHECK(argumentBytes <= kArgumentBytes);
  pass.noteContents();
  if (isFull(argumentBytes)) submit();
  Batch& batch = listing();
  Command command;
  command.kind = Command::Kind::draw;
  command.serial = pass.serial();
  command.pass = &pass;
  command.firstDraw = batch.draws.size();
  for (const DrawCall& draw : draws) {
    const bool isCounted = draw.count.buffer != VK_NULL_HANDLE;
    if (!isCounted && (draw.count.vertices == 0 || draw.count.instances == 0)) continue;
    batch.draws.push_back({draw.pipeline, addArguments(draw.arguments), draw.count});
  }
  command.drawCount = batch.draws.size() - command.firstDraw;
  add(command);
}

void GpuStream::copy(const GpuImage& from, const GpuBuffer& to, size_t offset) {
  checkCopy(from, to, offset);
  CHECK(from.hasContents_);
  Command command;
  command.kind = Command::Kind::copyFromImage;
  command.serial = from.serial();
  command.image = &from;
  command.to = to.handle();
  command.toOffset = to.offset() + offset;
  add(command);
}

void GpuStream::copy(const GpuBuffer& from, size_t offset, const GpuImage& to) {
  checkCopy(to, from, offset);
  to.hasContents_ = true;
  Command command;
  command.kind = Command::Kind::copyToImage;
  command.serial = to.serial();
  command.image = &to;
  command.from = from.handle();
  command.fromOffset = from.offset() + offset;
  add(command);
}

void GpuStream::recordPass(VkCommandBuffer commands, const Batch& batch, const Command& command) const {
  const GpuRenderPass& pass = *command.pass;
  const auto [width, height] = pass.size();
  auto info = vulkanStruct<VkRenderPassBeginInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_BEGIN_INFO);
  info.renderPass = pass.handle();
  info.framebuffer = pass.framebuffer();
  info.renderArea.extent = {width, height};
  info.clearValueCount = static_cast<uint32_t>(pass.clearValues().size());
  info.pClearValues = pass.clearValues().data();
  vkCmdBeginRenderPass(commands, &info, VK_SUBPASS_CONTENTS_INLINE);
  const VkViewport viewport = {0, 0, static_cast<float>(width), static_cast<float>(height), 0, 1};
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &info.renderArea);
  const GpuGraphicsPipeline* bound = nullptr;
  for (size_t i = 0; i < command.drawCount; ++i) {
    const Draw& draw = batch.draws[command.firstDraw + i];
    if (draw.pipeline != bound) vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, draw.pipeline->pipeline());
    bound = draw.pipeline;
    vkCmdPushConstants(commands, bound->layout(), GpuGraphicsPipeline::kStages, 0, sizeof draw.arguments,
                       &draw.arguments);
    if (draw.count.buffer != VK_NULL_HANDLE) {
      vkCmdDrawIndirect(commands, draw.count.buffer, draw.count.offset, 1, sizeof(VkDrawIndirectCommand));
    } else {
      vkCmdDraw(commands, draw.count.vertices, draw.count.instances, 0, 0);
    }
  }
  vkCmdEndRenderPass(commands);
}

void GpuStream::recordImageCopy(VkCommandBuffer commands, const Command& command) const {
  const GpuImage& image = *command.image;
  VkBufferImageCopy copy = {};
  copy.imageSubresource = {image.aspect(), 0, 0, 1};
  copy.imageExtent = {image.size().width, image.size().height, 1};
  if (command.kind == Command::Kind::copyFromImage) {
    copy.bufferOffset = command.toOffset;
    vkCmdCopyImageToBuffer(commands, image.handle(), GpuImage::kRestingLayout, command.to, 1, &copy);
    return;
  }
  copy.bufferOffset = command.fromOffset;
  changeLayout(commands, image, VK_IMAGE_LAYOUT_UNDEFINED, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL);
  vkCmdCopyBufferToImage(commands, command.from, image.handle(), VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
  changeLayout(commands, image, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, GpuImage::kRestingLayout);
}

void GpuStream::deferDestroy(std::shared_ptr<const GpuImage> image) {
  if (image) listing().deferredObjects.push_back(std::move(image));
}

void GpuStream::deferDestroy(std::shared_ptr<const GpuRenderPass> pass) {
  if (pass) listing().deferredObjects.push_back(std::move(pass));
}

std::shared_ptr<GpuImage> GpuStream::makeImage(ImageSize size, ImageFormat format) {
  try {
    return std::make_shared<GpuImage>(context_, size, format);
  } catch (const Error&) {
    finish();
    return std::make_shared<GpuImage>(context_, size, format);
  }
}

}  // namespace tessera
