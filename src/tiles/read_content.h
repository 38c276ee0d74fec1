// Reads contents and shared resources from files. Functions throw Error naming the file and what is wrong with it.
#pragma once

#include "base/file.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

std::unique_ptr<Content> readContent(const fs::path& path, const ContentCodec& codec, const Resources& resources = {},
                                     const ContentLimits& limits = {});
// Reads a content and checks that it is the one that tile number `tile` of tileset.json declares
// (Content::mismatchWith).
std::unique_ptr<Content> readVerifiedContent(const fs::path& path, const ContentCodec& codec, size_t tile,
                                             const TileContent& declared, const Resources& resources = {});
// Returns the memory that a content will take (Content::memoryBytes), from the JSON of its container alone: its texels
// are not read.
uint64_t readDecodedBytes(const fs::path& path, const ContentCodec& codec, const ContentLimits& limits = {});

// Reads a resource and checks that it takes no more memory than readResourceBytes() returned.
std::shared_ptr<const Resource> readResource(const fs::path& path, const ContentCodec& codec,
                                             const SharedResource& resource, const ContentLimits& limits = {});
// Returns an upper bound of the memory that a resource will take (ContentCodec::resourceMemoryBytes).
uint64_t readResourceBytes(const fs::path& path, const ContentCodec& codec, const SharedResource& resource);

}  // namespace tessera
