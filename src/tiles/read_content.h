// Contents by the names of their files, whatever their representation: VolumeContent or HashContent.
#pragma once

#include "base/file.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

// Throws Error naming the file.
template <class Content>
Content readContent(const fs::path& path, const ContentLimits& limits = {});
// And it must be the one that tile number `tile` of tileset.json speaks of: a surround where that says one, within the
// box there.
template <class Content>
Content readPromisedContent(const fs::path& path, size_t tile, const TileContent& promised);
// What a content will take in memory (bytesInMemory), by the JSON of its container alone: its texels are not read.
template <class Content>
uint64_t readDecodedBytes(const fs::path& path, const ContentLimits& limits = {});
uint64_t readDecodedBytes(const fs::path& path, Representation representation);
template <class Content>
Representation representationOf();

}  // namespace tessera
