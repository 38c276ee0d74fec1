// A persistent cache of compiled pipelines in $XDG_CACHE_HOME/tessera (or ~/.cache/tessera), one file per driver.
#pragma once

#include <volk.h>

#include <filesystem>

namespace tessera {

class PipelineCache {
 public:
  // The cache begins empty if there is no readable file, or if the file is damaged or of another driver.
  PipelineCache(VkDevice device, const VkPhysicalDeviceProperties& properties);
  ~PipelineCache();  // writes the file if the cache has grown; ignores errors
  PipelineCache(const PipelineCache&) = delete;
  PipelineCache& operator=(const PipelineCache&) = delete;

  VkPipelineCache handle() const { return cache_; }
  // Returns the path of the cache file; empty if neither XDG_CACHE_HOME nor HOME is set.
  static std::filesystem::path fileFor(const VkPhysicalDeviceProperties& properties);

 private:
  VkDevice device_;
  std::filesystem::path file_;
  size_t bytesRead_ = 0;
  VkPipelineCache cache_ = VK_NULL_HANDLE;
};

}  // namespace tessera
