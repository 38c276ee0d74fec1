// poses/left_out.json: the photos without poses, each with the likely reason. The stage `adjusting` writes it,
// `capture` adds those that turn out to be damaged, and `report` reads it.
#pragma once

#include <set>
#include <string>
#include <vector>

#include "base/file.h"
#include "photogrammetry/photo_list.h"

namespace tessera {

void writeLeftOut(const fs::path& file, const std::vector<LeftOutPhoto>& photos);

// Adds photos, each once, to those that the file lists; nothing if it does not exist.
void addLeftOut(const fs::path& file, const std::set<std::string>& names, const std::string& reason);

// Returns the photos, with names as UTF-8. Throws Error naming the file if it is missing or damaged.
std::vector<LeftOutPhoto> readLeftOut(const fs::path& file);

}  // namespace tessera
