// Which photos are held out of training.
#pragma once

#include <string>
#include <vector>

#include "import/source.h"

namespace tessera {

// Throws Error for what is neither "auto" nor a rule of holdOut, and for a list that cannot be read: before the work of
// importing, not after.
void checkHoldOut(const std::string& rule);

// Sets Photo::split of `photos`, which stand in natural name order.
//   every:N    photo 0, N, 2N, ... are test, the others train
//   list:FILE  the photos named in FILE, one a line (path, file name, or name without extension), are test
//   none       all are train
// Throws Error for another word, for a list none of whose names is a photo's, and when nothing would be left to train
// on.
void holdOut(const std::string& rule, std::vector<Photo>& photos);

// The same for the photos of a source; "auto" takes the source's own split, else every:8. Where a source has validation
// photos but no test photos, those become the test split.
void chooseSplit(SourceCapture& source, const std::string& rule);

}  // namespace tessera
