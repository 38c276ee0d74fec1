// The codecs of all representations that have scenes.
#pragma once

#include <memory>

#include "base/file.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

// Null where no representation has that name.
const ContentCodec* codecOf(std::string_view representation);

// Of a scene that was read from `folder`. Throws Error naming it where its representation is none that is known.
const ContentCodec& requireCodec(const fs::path& folder, const Tileset& tileset);

}  // namespace tessera
