#include "gpu/pipeline_cache.h"

#include <fmt/format.h>
#include <zlib.h>

#include <cstdlib>
#include <cstring>

#include "base/error.h"
#include "base/file.h"
#include "gpu/call.h"

namespace tessera {

namespace {

constexpr uint64_t kMaxBytes = uint64_t{256} << 20;
constexpr char kMagic[8] = {'t', 'e', 's', 's', 'v', 'k', 'c', '1'};

// Precedes the driver's data in the file. Drivers check which driver has written the data, but not whether it is
// intact.
struct Header {
  char magic[8];
  uint32_t checksum;
  uint32_t bytes;
};

uint32_t computeChecksum(std::span<const std::byte> bytes) {
  return static_cast<uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(bytes.size())));
}

// Returns the driver's data in a file; empty if the file is missing or damaged.
Bytes readDriverCache(const fs::path& file) {
  std::error_code ignored;
  if (file.empty() || !fs::exists(file, ignored)) return {};
  try {
    Bytes bytes = readFile(file, kMaxBytes);
    Header header;
    if (bytes.size() < sizeof header) return {};
    std::memcpy(&header, bytes.data(), sizeof header);
    bytes.erase(bytes.begin(), bytes.begin() + sizeof header);
    const bool whole = std::memcmp(header.magic, kMagic, sizeof kMagic) == 0 && header.bytes == bytes.size() &&
                       header.checksum == computeChecksum(bytes);
    return whole ? bytes : Bytes();
  } catch (const Error&) {
    return {};
  }
}

}  // namespace

fs::path PipelineCache::fileFor(const VkPhysicalDeviceProperties& properties) {
  fs::path folder;
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache && *cache) {
    folder = cache;
  } else if (const char* home = std::getenv("HOME"); home && *home) {
    folder = fs::path(home) / ".cache";
  } else {
    return {};
  }
  std::string name = "vulkan-";
  for (const uint8_t byte : properties.pipelineCacheUUID) name += fmt::format("{:02x}", byte);
  return folder / "tessera" / (name + ".bin");
}

PipelineCache::PipelineCache(VkDevice device, const VkPhysicalDeviceProperties& properties)
    : device_(device), file_(fileFor(properties)) {
  const Bytes bytes = readDriverCache(file_);
  auto info = vulkanStruct<VkPipelineCacheCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO);
  info.initialDataSize = bytes.size();
  info.pInitialData = bytes.data();
  checkVulkan(vkCreatePipelineCache(device_, &info, nullptr, &cache_), "vkCreatePipelineCache");
  bytesRead_ = bytes.size();
}

PipelineCache::~PipelineCache() {
  size_t size = 0;
  const bool known = vkGetPipelineCacheData(device_, cache_, &size, nullptr) == VK_SUCCESS;
  if (known && size > bytesRead_ && size <= kMaxBytes && !file_.empty()) {
    Bytes bytes(sizeof(Header) + size);
    if (vkGetPipelineCacheData(device_, cache_, &size, bytes.data() + sizeof(Header)) == VK_SUCCESS) {
      bytes.resize(sizeof(Header) + size);
      Header header;
      std::memcpy(header.magic, kMagic, sizeof kMagic);
      header.checksum = computeChecksum(std::span(bytes).subspan(sizeof header));
      header.bytes = static_cast<uint32_t>(size);
      std::memcpy(bytes.data(), &header, sizeof header);
      try {
        writeFileAtomically(file_, bytes);
      } catch (const std::exception&) {  // a cache that cannot be saved only costs time
      }
    }
  }
  vkDestroyPipelineCache(device_, cache_, nullptr);
}

}  // namespace tessera
