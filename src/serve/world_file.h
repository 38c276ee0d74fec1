// A world of the viewer (docs/world-format.md), as far as serving it needs it: where its scenes are.
#pragma once

#include <optional>
#include <string>

#include "base/file.h"

namespace tessera {

// What `path` names: a JSON file, or world.json in a folder that is no scene. Nothing where it is neither.
std::optional<fs::path> worldFileAt(const fs::path& path);

// Throws Error where it is no world, a server of its folder would not give it away, its scenes do not make a world
// (docs/world-format.md), or one of them has a relative address that leads to none that this server would give away.
// What else is in it is the viewer's to look at.
void requireWorld(const fs::path& worldFile);

// The address of a page below "/", so that the viewer there opens "/world/" + name.
std::string viewerOfWorld(const std::string& name);

}  // namespace tessera
