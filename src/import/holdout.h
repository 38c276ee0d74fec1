// Chooses which photos are held out of training.
#pragma once

#include <string>
#include <vector>

#include "import/source.h"

namespace tessera {

// Throws Error if `rule` is neither "auto" nor a rule of holdOut, or if its list cannot be read. It allows the importer
// to report such an error before its work instead of after it.
void checkHoldOut(const std::string& rule);

// Sets Photo::split of `photos`, which must be in natural name order.
//   every:N    photo 0, N, 2N, ... are test, the others train
//   list:FILE  the photos named in FILE, one per line (path, file name, or name without extension), are test
//   none       all are train
// Throws Error for any other rule, for a list that names none of the photos, and if no photo would be left for
// training.
void holdOut(const std::string& rule, std::vector<Photo>& photos);

// Sets the split of the photos of a source: "auto" takes the source's own split, else every:8; other rules are those of
// holdOut. Where a source has validation photos but no test photos, the validation photos become the test split.
void chooseSplit(SourceCapture& source, const std::string& rule);

}  // namespace tessera
