// poses/left_out.json: the photos without poses, each with the likely reason. The stage `adjusting` writes it, and
// `report` reads it.
#pragma once

#include <vector>

#include "base/file.h"
#include "photogrammetry/photo_list.h"

namespace tessera {

void writeLeftOut(const fs::path& file, const std::vector<LeftOutPhoto>& photos);

// Returns the photos, with names as UTF-8. Throws Error naming the file if it is missing or damaged.
std::vector<LeftOutPhoto> readLeftOut(const fs::path& file);

}  // namespace tessera
