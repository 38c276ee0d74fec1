#include "gpu/render_pass.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/stages.h"

namespace tessera {

namespace {

VkAttachmentLoadOp vulkanLoad(LoadOperation load) {
  switch (load) {
    case LoadOperation::clear:
      return VK_ATTACHMENT_LOAD_OP_CLEAR;
    case LoadOperation::keep:
      return VK_ATTACHMENT_LOAD_OP_LOAD;
    default:
      return VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  }
}

VkAttachmentDescription describe(ImageFormat format, LoadOperation load, bool isStored) {
  VkAttachmentDescription description = {};
  description.format = vulkanFormat(format);
  description.samples = VK_SAMPLE_COUNT_1_BIT;
  description.loadOp = vulkanLoad(load);
  description.storeOp = isStored ? VK_ATTACHMENT_STORE_OP_STORE : VK_ATTACHMENT_STORE_OP_DONT_CARE;
  description.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  description.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  // The undefined layout is valid as the initial one for an image in any layout; the image loses its contents.
  description.initialLayout = load == LoadOperation::keep ? GpuImage::kRestingLayout : VK_IMAGE_LAYOUT_UNDEFINED;
  description.finalLayout = GpuImage::kRestingLayout;
  return description;
}

// Colour attachments come first. All passes have the same dependencies, so a pipeline created for one is compatible
// with the others.
VkRenderPass makeRenderPass(const GpuContext& context, std::span<const VkAttachmentDescription> attachments,
                            size_t colourCount) {
  std::vector<VkAttachmentReference> colours;
  for (uint32_t i = 0; i < colourCount; ++i) colours.push_back({i, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL});
  const VkAttachmentReference depth = {static_cast<uint32_t>(colourCount),
                                       VK_IMAGE_LAYOUT_DEPTH_STENCIL_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass = {};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = static_cast<uint32_t>(colours.size());
  subpass.pColorAttachments = colours.data();
  subpass.pDepthStencilAttachment = attachments.size() > colourCount ? &depth : nullptr;

  // The barriers of a stream: a pass sees the results of all earlier commands, and later commands see its results.
  VkSubpassDependency before = {};
  before.srcSubpass = VK_SUBPASS_EXTERNAL;
  before.srcStageMask = stages::kStream | stages::kDrawing;
  before.srcAccessMask = stages::kStreamWrites | stages::kDrawingWrites;
  before.dstStageMask = stages::kDrawing | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT;
  before.dstAccessMask = stages::kDrawingReads | stages::kDrawingWrites | VK_ACCESS_INDIRECT_COMMAND_READ_BIT;
  VkSubpassDependency after = {};
  after.dstSubpass = VK_SUBPASS_EXTERNAL;
  after.srcStageMask = stages::kDrawing | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT;
  after.srcAccessMask = stages::kDrawingWrites;
  after.dstStageMask = stages::kStream;
  after.dstAccessMask = stages::kStreamReads | stages::kStreamWrites;
  const VkSubpassDependency dependencies[] = {before, after};

  auto info = vulkanStruct<VkRenderPassCreateInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO);
  info.attachmentCount = static_cast<uint32_t>(attachments.size());
  info.pAttachments = attachments.data();
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  info.dependencyCount = 2;
  info.pDependencies = dependencies;
  VkRenderPass pass = VK_NULL_HANDLE;
  checkVulkan(vkCreateRenderPass(context.device(), &info, nullptr, &pass), "vkCreateRenderPass");
  return pass;
}

void requireColours(const GpuContext& context, size_t count) {
  context.requireGraphics();
  if (count > context.limits().maxColorAttachments) {
    throw Error(context.name(), "",
                fmt::format("{} colour images are rendered at once, and it renders {} at most", count,
                            context.limits().maxColorAttachments),
                "choose another device (tessera info devices)");
  }
}

// The limits of framebuffers and viewports can be lower than those of images.
void requireSize(const GpuContext& context, ImageSize size) {
  const VkPhysicalDeviceLimits& limits = context.limits();
  const uint32_t width = std::min(limits.maxFramebufferWidth, limits.maxViewportDimensions[0]);
  const uint32_t height = std::min(limits.maxFramebufferHeight, limits.maxViewportDimensions[1]);
  if (size.width <= width && size.height <= height) return;
  throw Error(context.name(), "",
              fmt::format("{} x {} pixels are rendered at once, and it renders {} x {} at most", size.width,
                          size.height, width, height),
              "render smaller images, or choose another device (tessera info devices)");
}

}  // namespace

GpuRenderPass::GpuRenderPass(std::shared_ptr<const GpuContext> context, std::vector<ColourAttachment> colours,
                             std::optional<DepthAttachment> depth)
    : GpuRenderPass(std::move(context)) {  // from here on the destructor cleans up
  CHECK((!colours.empty() || depth.has_value()));
  requireColours(*context_, colours.size());
  colours_ = std::move(colours);
  depth_ = std::move(depth);
  serial_ = context_->nextSerial();
  size_ = depth_ ? depth_->image->size() : colours_[0].image->size();
  requireSize(*context_, size_);
  std::vector<VkAttachmentDescription> attachments;
  for (const ColourAttachment& colour : colours_) {
    CHECK(!isDepth(colour.image->format()));
    addAttachment(*colour.image);
    formats_.colours.push_back(colour.image->format());
    attachments.push_back(describe(colour.image->format(), colour.load, colour.isStored));
    VkClearValue& value = clearValues_.emplace_back();
    if (isInteger(colour.image->format())) {
      std::copy(colour.clearInteger.begin(), colour.clearInteger.end(), value.color.uint32);
    } else {
      std::copy(colour.clearColour.begin(), colour.clearColour.end(), value.color.float32);
    }
  }
  if (depth_) {
    CHECK(isDepth(depth_->image->format()));
    CHECK((depth_->clearDepth >= 0 && depth_->clearDepth <= 1));
    addAttachment(*depth_->image);
    formats_.depth = depth_->image->format();
    attachments.push_back(describe(depth_->image->format(), depth_->load, depth_->isStored));
    clearValues_.emplace_back().depthStencil = {depth_->clearDepth, 0};
  }
  pass_ = makeRenderPass(*context_, attachments, colours_.size());
  auto info = vulkanStruct<VkFramebufferCreateInfo>(VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO);
  info.renderPass = pass_;
  info.attachmentCount = static_cast<uint32_t>(views_.size());
  info.pAttachments = views_.data();
  info.width = size_.width;
  info.height = size_.height;
  info.layers = 1;
  checkVulkan(vkCreateFramebuffer(context_->device(), &info, nullptr, &framebuffer_), "vkCreateFramebuffer");
}

GpuRenderPass::~GpuRenderPass() {
  if (framebuffer_) vkDestroyFramebuffer(context_->device(), framebuffer_, nullptr);
  if (pass_) vkDestroyRenderPass(context_->device(), pass_, nullptr);
}

VkRenderPass GpuRenderPass::makeCompatible(const GpuContext& context, const AttachmentFormats& formats) {
  requireColours(context, formats.colours.size());
  std::vector<VkAttachmentDescription> attachments;
  for (const ImageFormat format : formats.colours) {
    attachments.push_back(describe(format, LoadOperation::clear, true));
  }
  if (formats.depth) attachments.push_back(describe(*formats.depth, LoadOperation::clear, true));
  return makeRenderPass(context, attachments, formats.colours.size());
}

void GpuRenderPass::addAttachment(const GpuImage& image) {
  CHECK((image.size() == size_));
  CHECK((std::find(views_.begin(), views_.end(), image.view()) == views_.end()));
  views_.push_back(image.view());
}

void GpuRenderPass::noteContents() const {
  for (const ColourAttachment& colour : colours_) {
    CHECK((colour.load != LoadOperation::keep || colour.image->hasContents_));
    colour.image->hasContents_ = colour.isStored;
  }
  if (!depth_) return;
  CHECK((depth_->load != LoadOperation::keep || depth_->image->hasContents_));
  depth_->image->hasContents_ = depth_->isStored;
}

}  // namespace tessera
