// Contents and shared resources by the names of their files. Functions throw Error naming the file and what is wrong
// with it.
#pragma once

#include "base/file.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

std::unique_ptr<Content> readContent(const fs::path& path, const ContentCodec& codec, const Resources& resources = {},
                                     const ContentLimits& limits = {});
// And it must be the one that tile number `tile` of tileset.json speaks of (Content::mismatchWith).
std::unique_ptr<Content> readPromisedContent(const fs::path& path, const ContentCodec& codec, size_t tile,
                                             const TileContent& promised, const Resources& resources = {});
// What a content will take in memory (Content::memoryBytes), by the JSON of its container alone: its texels are not
// read.
uint64_t readDecodedBytes(const fs::path& path, const ContentCodec& codec, const ContentLimits& limits = {});

// And it must take no more memory than readResourceBytes() said.
std::shared_ptr<const Resource> readResource(const fs::path& path, const ContentCodec& codec,
                                             const SharedResource& resource, const ContentLimits& limits = {});
// What a resource will take in memory at most (ContentCodec::resourceMemoryBytes).
uint64_t readResourceBytes(const fs::path& path, const ContentCodec& codec, const SharedResource& resource);

}  // namespace tessera
