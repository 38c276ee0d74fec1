// An in-order queue of device work: copies, fills, kernels and render passes are collected and submitted in batches;
// each sees the results of all commands before it. Only `download` and `finish` wait for all work. It must be used by
// one thread at a time. Functions that queue, submit or wait throw Error if the device is lost or memory is
// insufficient.
//
// A batch with the same commands as an earlier one (usually a training step) is not recorded again: the recorded
// command buffer is resubmitted with new arguments, which lie in memory. To make such batches frequent, small copies
// and fills are also kernels, whose addresses and sizes are arguments, and workgroup counts are rounded to few distinct
// values (workgroups()).
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

// The number of workgroups of a kernel: given directly, or read from device memory when the kernel is executed.
struct Groups {
  uint32_t x = 1, y = 1, z = 1;
  VkBuffer buffer = VK_NULL_HANDLE;  // if set, x, y and z are read from it at `offset`
  VkDeviceSize offset = 0;

  static Groups counted(const GpuBuffer& words, size_t offset) {
    return {.buffer = words.handle(), .offset = words.offset() + offset};
  }
  bool operator==(const Groups&) const = default;
};

// Returns the number of workgroups of `perGroup` elements for `count` elements, at most `maximum`, rounded up to one of
// few distinct values. Empty workgroups cost next to nothing.
uint32_t workgroups(size_t count, size_t perGroup, size_t maximum);

class GpuStream {
 public:
  // `stagingBytes` is the capacity of one batch for uploads; larger uploads take several batches.
  explicit GpuStream(std::shared_ptr<const GpuContext> context, size_t stagingBytes = size_t{16} << 20);
  ~GpuStream();  // waits for the device
  GpuStream(const GpuStream&) = delete;
  GpuStream& operator=(const GpuStream&) = delete;

  void upload(const GpuBuffer& to, size_t offset, std::span<const std::byte> bytes);
  struct Download {
    const GpuBuffer* from = nullptr;
    size_t offset = 0;
    std::span<std::byte> to;
  };
  void download(std::span<const Download> downloads);  // waits once per full staging buffer
  void download(const GpuBuffer& from, size_t offset, std::span<std::byte> to) {
    const Download one = {&from, offset, to};
    download(std::span(&one, 1));
  }
  void fillZero(const GpuBuffer& buffer, size_t offset, size_t bytes);  // multiples of 4
  // Copies `arguments` and runs the kernel with their address. Does nothing if the number of groups is 0. The kernel
  // must outlive the stream, whose recorded commands refer to it.
  void run(const GpuKernel& kernel, std::span<const std::byte> arguments, Groups groups);
  // Draws, in this order, into the images of the pass; a pass without draws still clears them. The `arguments` of each
  // draw are copied, and it runs with their address; they take at most 512 KiB in total, each rounded up to 64 bytes.
  // The writes of the draws of one pass to buffers are unordered, and none of the draws may read them. Vertex counts
  // are part of the recorded commands: if they change from frame to frame, store them in memory (DrawCount::counted).
  void draw(const GpuRenderPass& pass, std::span<const DrawCall> draws);
  void draw(const GpuRenderPass& pass, const DrawCall& one) { draw(pass, std::span(&one, 1)); }
  // Copies a whole image, [height][width] pixels; `offset` is a multiple of 4 and of the pixel size in bytes. An image
  // that is copied from must have contents.
  void copy(const GpuImage& from, const GpuBuffer& to, size_t offset);
  void copy(const GpuBuffer& from, size_t offset, const GpuImage& to);
  // Submits the commands queued so far. Does not wait for them, but for the batch submitted before them.
  void send();
  // Submits the commands queued so far and waits for all work.
  void finish();
  // Destroys the buffer once all commands queued so far have completed.
  void deferDestroy(GpuBuffer buffer);
  // Releases an image or a pass once all commands queued so far have completed. (Batches that used it are recorded
  // again with its replacement: reuse images and passes from frame to frame.)
  void deferDestroy(std::shared_ptr<const GpuImage> image);
  void deferDestroy(std::shared_ptr<const GpuRenderPass> pass);
  // Creates a buffer or an image in device memory. If memory is insufficient, tries again after all work has completed
  // and deferred objects are destroyed. Throws Error.
  GpuBuffer makeBuffer(size_t bytes);
  std::shared_ptr<GpuImage> makeImage(ImageSize size, ImageFormat format);

  // The device time of each label's commands since `measure(true)`. While measuring, every batch is recorded again.
  struct Measured {
    double seconds = 0;
    uint64_t commands = 0;
  };
  void measure(bool on);
  bool isMeasuring() const { return measuring_; }
  void label(std::string_view name) { label_ = name; }             // of the next commands; must outlive the stream
  const std::map<std::string, Measured, std::less<>>& measured();  // waits for all work

  // The number of batches that this stream has submitted so far, and how many of them had to be recorded.
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
    uint64_t serial = 0;  // of the pass or the image: distinguishes a destroyed one from a new one at the same address
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
    uint64_t generation = 0;  // of the heap: the recording must not be reused if buffers it refers to are gone
  };
  struct Batch {
    std::vector<Command> commands;
    std::vector<Draw> draws;               // of all its passes
    std::vector<std::string_view> labels;  // of each command, while measuring
    GpuBuffer staging, arguments;
    size_t staged = 0, argumentBytes = 0;  // bytes used of these buffers
    uint64_t done = 0;                     // the semaphore's value when the batch has completed; 0: not submitted
    std::vector<GpuBuffer> deferred;
    std::vector<std::shared_ptr<const void>> deferredObjects;  // images and passes
    std::array<Recording, 8> recordings;
    Recording small;  // of short batches, which are as quick to record as to look up: it replaces none of `recordings`
    VkQueryPool queries = VK_NULL_HANDLE;
    bool measured = false;
  };

  static constexpr size_t kAlignment = 64;           // of staged bytes and of arguments, bytes
  static constexpr size_t kCommandsPerBatch = 1024;  // a training step has a few hundred, more with many blocks
  static constexpr size_t kArgumentBytes = 512 * kCommandsPerBatch;
  static constexpr uint32_t kQueries = kCommandsPerBatch + 1;
  static size_t roundedUp(size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

  Batch& listing() { return batches_[current_]; }
  bool isFull(size_t argumentBytes) const;  // the batch has no space for another command with such arguments
  void add(const Command& command);
  void submit();  // submits the batch and begins the next one
  Recording& prepareRecording(Batch& batch);
  void record(Batch& batch, Recording& recording);
  void recordPass(VkCommandBuffer commands, const Batch& batch, const Command& command) const;
  void recordImageCopy(VkCommandBuffer commands, const Command& command) const;
  void wait(Batch& batch);
  void collect(Batch& batch);                                          // reads the timestamps
  VkDeviceAddress addArguments(std::span<const std::byte> arguments);  // they must fit
  size_t stage(std::span<const std::byte> bytes);  // returns the offset in the staging buffer; the bytes must fit
  // Copies by a kernel, or zeroes if `from` is 0. Returns false if there are too many bytes or they are not whole
  // words.
  bool copyWords(VkDeviceAddress from, VkDeviceAddress to, size_t bytes);

  std::shared_ptr<const GpuContext> context_;
  size_t stagingBytes_;
  GpuKernel copyWords_, zeroWords_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkSemaphore timeline_ = VK_NULL_HANDLE;
  std::array<Batch, 2> batches_;  // one is filled while the device executes the other
  int current_ = 0;
  uint64_t sent_ = 0, recorded_ = 0;
  GpuBuffer downloads_;
  bool measuring_ = false;
  std::string_view label_;
  std::map<std::string, Measured, std::less<>> measured_;
};

}  // namespace tessera
