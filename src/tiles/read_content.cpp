#include "tiles/read_content.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "tiles/content_file.h"
#include "tiles/glb.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

Error noContent(const fs::path& path, const std::string& reason) {
  return {path.string(), "", reason, "copy the scene again, or bake it again"};
}

void requireIntact(const fs::path& path, const Bytes& file) {
  if (!hasItsDigest(path, file)) throw noContent(path, "is damaged: its bytes are not those that were written");
}

}  // namespace

std::unique_ptr<Content> readContent(const fs::path& path, const ContentCodec& codec, const Resources& resources,
                                     const ContentLimits& limits) {
  std::string reason;
  const Bytes file = readFile(path, limits.fileBytes);
  auto content = codec.decode(file, resources, reason, limits);
  if (!content) throw noContent(path, reason);
  requireIntact(path, file);
  return content;
}

std::unique_ptr<Content> readVerifiedContent(const fs::path& path, const ContentCodec& codec, size_t tile,
                                             const TileContent& declared, const Resources& resources) {
  auto content = readContent(path, codec, resources);
  if (const auto mismatch = content->mismatchWith(declared)) {
    throw Error(path.string(), fmt::format("of tile {} in tileset.json", tile), *mismatch,
                "copy the scene again, or bake it again");
  }
  return content;
}

uint64_t readDecodedBytes(const fs::path& path, const ContentCodec& codec, const ContentLimits& limits) {
  std::error_code status;
  const auto length = readJsonLength(readFileStart(path, kGlbStart), fs::file_size(path, status));
  if (!length) throw noContent(path, kNoGlb);
  // One byte more than allowed is enough to detect that the JSON is too long.
  const Bytes start = readFileStart(path, kGlbStart + std::min<uint64_t>(*length, kMaxContentJson + 1));
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  std::string reason;
  const auto bytes = codec.memoryBytes(text.substr(std::min(kGlbStart, text.size())), reason, limits);
  if (!bytes) throw noContent(path, reason);
  return *bytes;
}

std::shared_ptr<const Resource> readResource(const fs::path& path, const ContentCodec& codec,
                                             const SharedResource& resource, const ContentLimits& limits) {
  std::string reason;
  const Bytes file = readFile(path, limits.fileBytes);
  auto decoded = codec.decodeResource(file, resource, reason, limits);
  if (!decoded) throw noContent(path, reason);
  requireIntact(path, file);
  // The size that budgets have charged for it.
  const uint64_t charged = codec.resourceMemoryBytes(resource, file.size());
  if (decoded->memoryBytes() > charged) {
    throw noContent(path, fmt::format("takes {} bytes of memory, its size said {}", decoded->memoryBytes(), charged));
  }
  return decoded;
}

uint64_t readResourceBytes(const fs::path& path, const ContentCodec& codec, const SharedResource& resource) {
  std::error_code status;
  const uint64_t bytes = fs::file_size(path, status);
  if (status) throw noContent(path, "there is no such file");
  return codec.resourceMemoryBytes(resource, bytes);
}

}  // namespace tessera
