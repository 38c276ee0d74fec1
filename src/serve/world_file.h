// Checks a world file of the viewer (docs/world-format.md) as far as a server needs to know it: the addresses of its
// scenes.
#pragma once

#include <optional>
#include <string>

#include "base/file.h"

namespace tessera {

// Returns `path` if it is a JSON file, or its world.json if it is a folder that is not a scene; otherwise nothing.
std::optional<fs::path> worldFileAt(const fs::path& path);

// Throws Error if the file is not a world, a server of its folder would not serve it, its list of scenes is invalid
// (docs/world-format.md), or a scene has a relative address that does not lead to a scene that the server would serve.
// Everything else in the file is left to the viewer to check.
void requireWorld(const fs::path& worldFile);

// Returns the address, relative to "/", at which the viewer opens the world "/world/" + name.
std::string viewerOfWorld(const std::string& name);

}  // namespace tessera
