#include "gpu/stream.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"
#include "gpu/stages.h"
#include "shaders/copy_words.h"

namespace tessera {

namespace {

constexpr size_t kSmallBatch = 8;                    // commands, and draws of passes
constexpr size_t kMaxCopiedWords = size_t{1} << 20;  // by a kernel: larger copies usually have the same size next time

void barrier(VkCommandBuffer commands, VkAccessFlags reads, VkPipelineStageFlags to) {
  auto barrier = vulkanStruct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = stages::kStreamWrites;
  barrier.dstAccessMask = reads;
  vkCmdPipelineBarrier(commands, stages::kStream, to, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

}  // namespace

uint32_t workgroups(size_t count, size_t perGroup, size_t maximum) {
  size_t groups = (count + perGroup - 1) / perGroup;
  const int spare = static_cast<int>(std::bit_width(groups)) - 4;
  if (spare > 0) groups = ((groups + (size_t{1} << spare) - 1) >> spare) << spare;
  return static_cast<uint32_t>(std::min(groups, maximum));
}

GpuStream::GpuStream(std::shared_ptr<const GpuContext> context, size_t stagingBytes)
    : context_(std::move(context)),
      stagingBytes_(stagingBytes / kAlignment * kAlignment),
      copyWords_(context_, kCopyWordsSpirv),
      zeroWords_(context_, kCopyWordsSpirv, std::array{1u}) {
  CHECK(size_t{0} < stagingBytes_);
  const VkDevice device = context_->device();
  auto poolInfo = vulkanStruct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  poolInfo.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  poolInfo.queueFamilyIndex = context_->queueFamily();
  checkVulkan(vkCreateCommandPool(device, &poolInfo, nullptr, &pool_), "vkCreateCommandPool");
  auto type = vulkanStruct<VkSemaphoreTypeCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_TYPE_CREATE_INFO);
  type.semaphoreType = VK_SEMAPHORE_TYPE_TIMELINE;
  auto semaphoreInfo = vulkanStruct<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO);
  semaphoreInfo.pNext = &type;
  checkVulkan(vkCreateSemaphore(device, &semaphoreInfo, nullptr, &timeline_), "vkCreateSemaphore");
  for (Batch& batch : batches_) {
    const auto makeBuffer = [&](Recording& recording) {
      auto info = vulkanStruct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
      info.commandPool = pool_;
      info.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
      info.commandBufferCount = 1;
      checkVulkan(vkAllocateCommandBuffers(device, &info, &recording.buffer), "vkAllocateCommandBuffers");
    };
    for (Recording& recording : batch.recordings) makeBuffer(recording);
    makeBuffer(batch.small);
    batch.staging = GpuBuffer(context_, stagingBytes_, BufferUse::upload);
    batch.arguments = GpuBuffer(context_, kArgumentBytes, BufferUse::upload);
  }
}

GpuStream::~GpuStream() {
  const VkDevice device = context_->device();
  vkDeviceWaitIdle(device);
  for (Batch& batch : batches_) {
    if (batch.queries) vkDestroyQueryPool(device, batch.queries, nullptr);
  }
  vkDestroySemaphore(device, timeline_, nullptr);
  vkDestroyCommandPool(device, pool_, nullptr);
}

void GpuStream::add(const Command& command) {
  if (listing().commands.size() >= kCommandsPerBatch) submit();
  listing().commands.push_back(command);
  if (measuring_) listing().labels.push_back(label_);
}

void GpuStream::submit() {
  Batch& batch = listing();
  Recording& recording = prepareRecording(batch);
  batch.done = ++sent_;
  recording.lastUse = sent_;
  auto values = vulkanStruct<VkTimelineSemaphoreSubmitInfo>(VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO);
  values.signalSemaphoreValueCount = 1;
  values.pSignalSemaphoreValues = &batch.done;
  auto info = vulkanStruct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  info.pNext = &values;
  info.commandBufferCount = 1;
  info.pCommandBuffers = &recording.buffer;
  info.signalSemaphoreCount = 1;
  info.pSignalSemaphores = &timeline_;
  checkVulkan(vkQueueSubmit(context_->queue(), 1, &info, VK_NULL_HANDLE), "vkQueueSubmit");
  current_ = 1 - current_;
  wait(listing());
}

GpuStream::Recording& GpuStream::prepareRecording(Batch& batch) {
  const uint64_t generation = context_->heap().generation();
  if (batch.commands.size() + batch.draws.size() < kSmallBatch) {
    record(batch, batch.small);
    return batch.small;
  }
  if (!measuring_) {
    for (Recording& entry : batch.recordings) {
      if (entry.generation == generation && entry.commands == batch.commands && entry.draws == batch.draws) {
        return entry;
      }
    }
  }
  Recording& oldest = *std::min_element(batch.recordings.begin(), batch.recordings.end(),
                                        [](const Recording& a, const Recording& b) { return a.lastUse < b.lastUse; });
  oldest.generation = 0;  // invalid if recording fails
  record(batch, oldest);
  oldest.commands = measuring_ ? std::vector<Command>() : batch.commands;
  oldest.draws = measuring_ ? std::vector<Draw>() : batch.draws;
  oldest.generation = measuring_ ? 0 : generation;
  return oldest;
}

void GpuStream::record(Batch& batch, Recording& recording) {
  ++recorded_;
  const VkCommandBuffer commands = recording.buffer;
  const auto info = vulkanStruct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  checkVulkan(vkBeginCommandBuffer(commands, &info), "vkBeginCommandBuffer");
  batch.measured = measuring_;
  if (measuring_) {
    vkCmdResetQueryPool(commands, batch.queries, 0, kQueries);
    vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, batch.queries, 0);
  }
  uint32_t query = 0;
  for (const Command& command : batch.commands) {
    // A barrier also covers all batches submitted before, as there is one queue. Render passes have their own barriers.
    if (command.kind != Command::Kind::draw) {
      barrier(commands, stages::kStreamReads | stages::kStreamWrites, stages::kStream);
    }
    switch (command.kind) {
      case Command::Kind::copy: {
        const VkBufferCopy copy = {command.fromOffset, command.toOffset, command.bytes};
        vkCmdCopyBuffer(commands, command.from, command.to, 1, &copy);
        break;
      }
      case Command::Kind::fill:
        vkCmdFillBuffer(commands, command.to, command.toOffset, command.bytes, 0);
        break;
      case Command::Kind::kernel:
        vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, command.kernel->pipeline());
        vkCmdPushConstants(commands, command.kernel->layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, sizeof command.arguments,
                           &command.arguments);
        if (command.groups.buffer != VK_NULL_HANDLE) {
          vkCmdDispatchIndirect(commands, command.groups.buffer, command.groups.offset);
        } else {
          vkCmdDispatch(commands, command.groups.x, command.groups.y, command.groups.z);
        }
        break;
      case Command::Kind::draw:
        recordPass(commands, batch, command);
        break;
      case Command::Kind::copyFromImage:
      case Command::Kind::copyToImage:
        recordImageCopy(commands, command);
        break;
    }
    if (measuring_) {
      vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, batch.queries, ++query);
    }
  }
  barrier(commands, VK_ACCESS_HOST_READ_BIT, VK_PIPELINE_STAGE_HOST_BIT);
  checkVulkan(vkEndCommandBuffer(commands), "vkEndCommandBuffer");
}

void GpuStream::wait(Batch& batch) {
  if (batch.done > 0) {
    auto info = vulkanStruct<VkSemaphoreWaitInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_WAIT_INFO);
    info.semaphoreCount = 1;
    info.pSemaphores = &timeline_;
    info.pValues = &batch.done;
    checkVulkan(vkWaitSemaphores(context_->device(), &info, UINT64_MAX), "vkWaitSemaphores");
    if (batch.measured) collect(batch);
  }
  batch.done = 0;
  batch.measured = false;
  batch.commands.clear();
  batch.draws.clear();
  batch.labels.clear();
  batch.staged = batch.argumentBytes = 0;
  batch.deferred.clear();
  batch.deferredObjects.clear();
}

void GpuStream::send() {
  const Batch& batch = listing();
  if (!batch.commands.empty() || !batch.deferred.empty() || !batch.deferredObjects.empty()) submit();
}

void GpuStream::finish() {
  send();
  for (Batch& batch : batches_) wait(batch);
}

size_t GpuStream::stage(std::span<const std::byte> bytes) {
  Batch& batch = listing();
  const size_t offset = batch.staged;
  CHECK(bytes.size() <= stagingBytes_ - offset);
  std::memcpy(batch.staging.mapped() + offset, bytes.data(), bytes.size());
  batch.staged += roundedUp(bytes.size());
  return offset;
}

void GpuStream::upload(const GpuBuffer& to, size_t offset, std::span<const std::byte> bytes) {
  CHECK(offset + bytes.size() <= to.bytes());
  while (!bytes.empty()) {
    // Staged bytes must be copied by a command of the same batch.
    if (listing().staged == stagingBytes_ || isFull(kAlignment)) submit();
    const size_t length = std::min(bytes.size(), stagingBytes_ - listing().staged);
    const size_t staged = stage(bytes.first(length));
    const GpuBuffer& staging = listing().staging;
    if (!copyWords(staging.address() + staged, to.address() + offset, length)) {
      Command copy;
      copy.from = staging.handle();
      copy.fromOffset = staging.offset() + staged;
      copy.to = to.handle();
      copy.toOffset = to.offset() + offset;
      copy.bytes = length;
      add(copy);
    }
    bytes = bytes.subspan(length);
    offset += length;
  }
}

bool GpuStream::isFull(size_t argumentBytes) const {
  const Batch& batch = batches_[current_];
  return batch.commands.size() >= kCommandsPerBatch || kArgumentBytes - batch.argumentBytes < argumentBytes;
}

bool GpuStream::copyWords(VkDeviceAddress from, VkDeviceAddress to, size_t bytes) {
  if (from % 4 != 0 || to % 4 != 0 || bytes % 4 != 0 || bytes / 4 > kMaxCopiedWords) return false;
  struct {
    VkDeviceAddress from, to;
    uint32_t words, unused = 0;
  } const arguments = {from, to, static_cast<uint32_t>(bytes / 4)};
  const uint32_t groups = workgroups(arguments.words, 64, context_->limits().maxComputeWorkGroupCount[0]);
  run(from != 0 ? copyWords_ : zeroWords_, std::as_bytes(std::span(&arguments, 1)), {groups});
  return true;
}

void GpuStream::download(std::span<const Download> downloads) {
  if (!downloads_) downloads_ = GpuBuffer(context_, stagingBytes_, BufferUse::download);
  struct Piece {
    std::span<std::byte> to;
    size_t at;
  };
  std::vector<Piece> pieces;  // in `downloads_`
  size_t used = 0;
  const auto readBack = [&] {
    finish();
    for (const Piece& piece : pieces) std::memcpy(piece.to.data(), downloads_.mapped() + piece.at, piece.to.size());
    pieces.clear();
    used = 0;
  };
  for (const auto& [from, offset, to] : downloads) {
    CHECK(offset + to.size() <= from->bytes());
    for (size_t done = 0; done < to.size();) {
      if (used == stagingBytes_) readBack();
      const size_t length = std::min(to.size() - done, stagingBytes_ - used);
      if (!copyWords(from->address() + offset + done, downloads_.address() + used, length)) {
        Command copy;
        copy.from = from->handle();
        copy.fromOffset = from->offset() + offset + done;
        copy.to = downloads_.handle();
        copy.toOffset = downloads_.offset() + used;
        copy.bytes = length;
        add(copy);
      }
      pieces.push_back({to.subspan(done, length), used});
      done += length;
      used += roundedUp(length);
    }
  }
  if (!pieces.empty()) readBack();
}

void GpuStream::fillZero(const GpuBuffer& buffer, size_t offset, size_t bytes) {
  CHECK(offset % 4 == 0u);
  CHECK(bytes % 4 == 0u);
  if (bytes == 0 || copyWords(0, buffer.address() + offset, bytes)) return;
  Command fill;
  fill.kind = Command::Kind::fill;
  fill.to = buffer.handle();
  fill.toOffset = buffer.offset() + offset;
  fill.bytes = bytes;
  add(fill);
}

void GpuStream::run(const GpuKernel& kernel, std::span<const std::byte> arguments, Groups groups) {
  if (groups.x == 0 || groups.y == 0 || groups.z == 0) return;
  CHECK(arguments.size() <= kArgumentBytes);
  CHECK(groups.x <= context_->limits().maxComputeWorkGroupCount[0]);
  CHECK(groups.y <= context_->limits().maxComputeWorkGroupCount[1]);
  CHECK(groups.z <= context_->limits().maxComputeWorkGroupCount[2]);
  if (isFull(arguments.size())) submit();
  Command command;
  command.kind = Command::Kind::kernel;
  command.kernel = &kernel;
  command.arguments = addArguments(arguments);
  command.groups = groups;
  add(command);
}

VkDeviceAddress GpuStream::addArguments(std::span<const std::byte> arguments) {
  Batch& batch = listing();
  if (!arguments.empty()) {
    std::memcpy(batch.arguments.mapped() + batch.argumentBytes, arguments.data(), arguments.size());
  }
  const VkDeviceAddress address = batch.arguments.address() + batch.argumentBytes;
  batch.argumentBytes += roundedUp(arguments.size());
  return address;
}

void GpuStream::deferDestroy(GpuBuffer buffer) {
  if (buffer) listing().deferred.push_back(std::move(buffer));
}

GpuBuffer GpuStream::makeBuffer(size_t bytes) {
  try {
    return GpuBuffer(context_, bytes);
  } catch (const Error&) {
    finish();
    return GpuBuffer(context_, bytes);
  }
}

void GpuStream::measure(bool on) {
  finish();
  if (on && context_->timestampBits() == 0) {
    throw Error(context_->name(), "", "its queue has no timestamps", "leave TESSERA_GPU_TIMES out");
  }
  measuring_ = on;
  measured_.clear();
  if (!on) return;
  for (Batch& batch : batches_) {
    if (batch.queries) continue;
    auto info = vulkanStruct<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
    info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    info.queryCount = kQueries;
    checkVulkan(vkCreateQueryPool(context_->device(), &info, nullptr, &batch.queries), "vkCreateQueryPool");
  }
}

void GpuStream::collect(Batch& batch) {
  const uint32_t count = static_cast<uint32_t>(batch.labels.size()) + 1;
  std::vector<uint64_t> ticks(count);
  checkVulkan(vkGetQueryPoolResults(context_->device(), batch.queries, 0, count, count * sizeof(uint64_t), ticks.data(),
                                    sizeof(uint64_t), VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
              "vkGetQueryPoolResults");
  const uint32_t bits = context_->timestampBits();
  const uint64_t mask = bits >= 64 ? ~uint64_t{0} : (uint64_t{1} << bits) - 1;
  const double secondsPerTick = 1e-9 * context_->limits().timestampPeriod;
  for (uint32_t i = 0; i + 1 < count; ++i) {
    Measured& all = measured_[std::string(batch.labels[i])];
    all.seconds += secondsPerTick * static_cast<double>((ticks[i + 1] - ticks[i]) & mask);
    ++all.commands;
  }
}

const std::map<std::string, GpuStream::Measured, std::less<>>& GpuStream::measured() {
  finish();
  return measured_;
}

}  // namespace tessera
