// The codecs of all representations that have scenes.
#pragma once

#include <memory>

#include "base/file.h"
#include "tiles/content.h"
#include "tiles/tileset.h"

namespace tessera {

// Returns the codec of the named representation, or null if there is none of that name.
const ContentCodec* findCodec(std::string_view representation);

// Returns the codec for a scene that was read from `folder`. Throws Error naming that scene's tileset.json if its
// representation is unknown.
const ContentCodec& requireCodec(const fs::path& folder, const Tileset& tileset);

}  // namespace tessera
