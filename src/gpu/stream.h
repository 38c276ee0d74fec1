// Work for the device, in order: copies, fills, kernels and render passes are listed and sent in batches; each sees all
// that came before it. Only `download` and `finish` wait for all. For one thread at a time.
//
// A batch that is the same list as one before (a training step, mostly) is not recorded again: its commands are sent
// once more with new arguments, which lie in memory. So that it is, small copies and fills are kernels, too: what they
// move and how much is an argument then; and numbers of workgroups are few different ones (workgroups()).
#pragma once

#include <volk.h>

#include <array>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gpu/buffer.h"
#include "gpu/graphics_pipeline.h"
#include "gpu/image.h"
#include "gpu/kernel.h"
#include "gpu/render_pass.h"

namespace tessera {

// How many workgroups run a kernel: a number, or what stands in the device's memory when the kernel's turn has come.
struct Groups {
  uint32_t x = 1, y = 1, z = 1;
  VkBuffer buffer = VK_NULL_HANDLE;  // where set: x, y and z are read at `offset` of it
  VkDeviceSize offset = 0;

  static Groups counted(const GpuBuffer& words, size_t offset) {
    return {.buffer = words.handle(), .offset = words.offset() + offset};
  }
  bool operator==(const Groups&) const = default;
};

// Enough of `perGroup` for `count`, and a few more: one of few different numbers. Empty ones cost next to nothing.
uint32_t workgroups(size_t count, size_t perGroup, size_t most);

class GpuStream {
 public:
  // `stagingBytes` is what one batch can carry of uploads; larger ones take several batches.
  explicit GpuStream(std::shared_ptr<const GpuContext> context, size_t stagingBytes = size_t{16} << 20);
  ~GpuStream();  // waits
  GpuStream(const GpuStream&) = delete;
  GpuStream& operator=(const GpuStream&) = delete;

  void upload(const GpuBuffer& to, size_t offset, std::span<const std::byte> bytes);
  struct Download {
    const GpuBuffer* from = nullptr;
    size_t offset = 0;
    std::span<std::byte> to;
  };
  void download(std::span<const Download> downloads);  // waits, once for as many as staging holds
  void download(const GpuBuffer& from, size_t offset, std::span<std::byte> to) {
    const Download one = {&from, offset, to};
    download(std::span(&one, 1));
  }
  void fillZero(const GpuBuffer& buffer, size_t offset, size_t bytes);  // multiples of 4
  // Copies `arguments` and runs the kernel with their address. No groups, no work. The kernel stays until the stream
  // goes: what was recorded names it.
  void run(const GpuKernel& kernel, std::span<const std::byte> arguments, Groups groups);
  // Draws, in this order, into the images of the pass; none at all still clears them. Each draw has its `arguments`
  // copied and runs with their address; 512 KiB in all, each rounded up to 64 bytes. What the draws of one pass write
  // to buffers is in no order, and none of them may read it. Numbers of vertices are a part of what is recorded: where
  // they change from picture to picture, let them stand in memory (DrawCount::counted).
  void draw(const GpuRenderPass& pass, std::span<const DrawCall> draws);
  void draw(const GpuRenderPass& pass, const DrawCall& one) { draw(pass, std::span(&one, 1)); }
  // All of an image, [height][width] pixels; `offset` is a multiple of 4 and of a pixel's bytes. An image that is
  // copied from has contents.
  void copy(const GpuImage& from, const GpuBuffer& to, size_t offset);
  void copy(const GpuBuffer& from, size_t offset, const GpuImage& to);
  void send();  // what has been listed begins now; waits for none of it, but for what was sent before the last time
  void finish();
  // Destroys the buffer once nothing queued so far can touch it.
  void retire(GpuBuffer buffer);
  // Lets go of an image or a pass once nothing queued so far can touch it. (Batches that name it are recorded anew with
  // another in its place: keep them from picture to picture.)
  void retire(std::shared_ptr<const GpuImage> image);
  void retire(std::shared_ptr<const GpuRenderPass> pass);
  // A buffer of the device's; where memory is short, once what has been retired is gone. Throws Error.
  GpuBuffer makeBuffer(size_t bytes);
  std::shared_ptr<GpuImage> makeImage(ImageSize size, ImageFormat format);

  // What each label's commands took on the device since `measure(true)`. Batches are then recorded anew each time.
  struct Measured {
    double seconds = 0;
    uint64_t commands = 0;
  };
  void measure(bool on);
  bool isMeasuring() const { return measuring_; }
  void label(std::string_view name) { label_ = name; }             // of what comes next; outlives the stream
  const std::map<std::string, Measured, std::less<>>& measured();  // waits

  // Of this stream so far: batches sent, and those of them that had to be recorded.
  uint64_t batchesSent() const { return sent_; }
  uint64_t batchesRecorded() const { return recorded_; }

  const std::shared_ptr<const GpuContext>& context() const { return context_; }

 private:
  struct Command {
    enum class Kind { copy, fill, kernel, draw, copyFromImage, copyToImage } kind = Kind::copy;
    VkBuffer from = VK_NULL_HANDLE, to = VK_NULL_HANDLE;
    size_t fromOffset = 0, toOffset = 0, bytes = 0;
    const GpuKernel* kernel = nullptr;
    VkDeviceAddress arguments = 0;
    Groups groups;
    uint64_t serial = 0;  // of the pass or the image: those that are gone are never equal to others at their addresses
    const GpuRenderPass* pass = nullptr;
    const GpuImage* image = nullptr;
    size_t firstDraw = 0, drawCount = 0;  // of the batch's draws
    bool operator==(const Command&) const = default;
  };
  struct Draw {
    const GpuGraphicsPipeline* pipeline = nullptr;
    VkDeviceAddress arguments = 0;
    DrawCount count;
    bool operator==(const Draw&) const = default;
  };
  struct Recording {
    std::vector<Command> commands;
    std::vector<Draw> draws;
    VkCommandBuffer buffer = VK_NULL_HANDLE;
    uint64_t lastUse = 0;
    uint64_t generation = 0;  // of the heap: buffers that have gone must not be named again
  };
  struct Batch {
    std::vector<Command> commands;
    std::vector<Draw> draws;               // of all its passes
    std::vector<std::string_view> labels;  // of each command, while measuring
    GpuBuffer staging, arguments;
    size_t staged = 0, argumentBytes = 0;  // of those that are used
    uint64_t done = 0;                     // the semaphore's value then
    std::vector<GpuBuffer> retired;
    std::vector<std::shared_ptr<const void>> retiredObjects;  // images and passes
    std::array<Recording, 8> recordings;
    Recording small;  // of what is as soon recorded as found: it displaces none of those
    VkQueryPool queries = VK_NULL_HANDLE;
    bool measured = false;
  };

  static constexpr size_t kAlignment = 64;           // of staged bytes and of arguments
  static constexpr size_t kCommandsPerBatch = 1024;  // a training step has some hundreds, and more with many blocks
  static constexpr size_t kArgumentBytes = 512 * kCommandsPerBatch;
  static constexpr uint32_t kQueries = kCommandsPerBatch + 1;
  static size_t roundedUp(size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

  Batch& listing() { return batches_[current_]; }
  bool isFull(size_t argumentBytes) const;  // the batch: for one more command
  void add(const Command& command);
  void submit();  // sends the batch, and begins the next one
  Recording& recordingOf(Batch& batch);
  void record(Batch& batch, Recording& recording);
  void recordPass(VkCommandBuffer commands, const Batch& batch, const Command& command) const;
  void recordImageCopy(VkCommandBuffer commands, const Command& command) const;
  void wait(Batch& batch);
  void collect(Batch& batch);                                          // timestamps
  VkDeviceAddress addArguments(std::span<const std::byte> arguments);  // they must fit
  size_t stage(std::span<const std::byte> bytes);  // → offset in the staging buffer; the bytes must fit
  // By a kernel, where that can be done: few words, and whole ones.
  bool copyWords(VkDeviceAddress from, VkDeviceAddress to, size_t bytes);

  std::shared_ptr<const GpuContext> context_;
  size_t stagingBytes_;
  GpuKernel copyWords_, zeroWords_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkSemaphore timeline_ = VK_NULL_HANDLE;
  std::array<Batch, 2> batches_;  // one is listed while the device works on the other
  int current_ = 0;
  uint64_t sent_ = 0, recorded_ = 0;
  GpuBuffer downloads_;
  bool measuring_ = false;
  std::string_view label_;
  std::map<std::string, Measured, std::less<>> measured_;
};

}  // namespace tessera
