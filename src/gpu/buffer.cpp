#include "gpu/buffer.h"

#include <utility>

namespace tessera {

GpuBuffer::GpuBuffer(std::shared_ptr<const GpuContext> context, size_t bytes, BufferUse use)
    : context_(std::move(context)), piece_(context_->heap().allocate(bytes, use)), bytes_(bytes) {}

GpuBuffer::~GpuBuffer() {
  if (piece_.block) context_->heap().free(piece_);
}

GpuBuffer& GpuBuffer::operator=(GpuBuffer&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(piece_, other.piece_);
  std::swap(bytes_, other.bytes_);
  return *this;
}

}  // namespace tessera
