// Compiled kernels kept from run to run, in $XDG_CACHE_HOME/tessera (or ~/.cache/tessera), a file for each driver.
#pragma once

#include <volk.h>

#include <filesystem>

namespace tessera {

class PipelineCache {
 public:
  // Without a readable file, or where it is damaged or another driver's, the cache begins empty.
  PipelineCache(VkDevice device, const VkPhysicalDeviceProperties& properties);
  ~PipelineCache();  // writes the file, where there is more to keep than was read; says nothing where it cannot
  PipelineCache(const PipelineCache&) = delete;
  PipelineCache& operator=(const PipelineCache&) = delete;

  VkPipelineCache handle() const { return cache_; }
  // Empty where there is no home to write to.
  static std::filesystem::path fileFor(const VkPhysicalDeviceProperties& properties);

 private:
  VkDevice device_;
  std::filesystem::path file_;
  size_t bytesRead_ = 0;
  VkPipelineCache cache_ = VK_NULL_HANDLE;
};

}  // namespace tessera
