// Kernels of one drawer, made when they are first run: by their code and the one constant that they are specialised by.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <utility>

#include "gpu/kernel.h"

namespace tessera {

class KernelVariants {
 public:
  explicit KernelVariants(std::shared_ptr<const GpuContext> context) : context_(std::move(context)) {}

  // `spirv` must be there as long as this is.
  const GpuKernel& get(std::span<const uint32_t> spirv, uint32_t constant) {
    const auto key = std::make_pair(spirv.data(), constant);
    const auto found = kernels_.find(key);
    if (found != kernels_.end()) return found->second;
    return kernels_.try_emplace(key, context_, spirv, std::span(&constant, 1)).first->second;
  }

 private:
  std::shared_ptr<const GpuContext> context_;
  std::map<std::pair<const uint32_t*, uint32_t>, GpuKernel> kernels_;
};

}  // namespace tessera
