// The kernels of one drawer, created when they are first used. They are identified by their code and one
// specialisation constant.
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

  // `spirv` must outlive this object.
  const GpuKernel& get(std::span<const uint32_t> spirv, uint32_t constant) {
    const auto key = std::make_pair(spirv.data(), constant);
    const auto it = kernels_.find(key);
    if (it != kernels_.end()) return it->second;
    return kernels_.try_emplace(key, context_, spirv, std::span(&constant, 1)).first->second;
  }

 private:
  std::shared_ptr<const GpuContext> context_;
  std::map<std::pair<const uint32_t*, uint32_t>, GpuKernel> kernels_;
};

}  // namespace tessera
