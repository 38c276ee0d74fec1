// Which photos are held out of training.
#pragma once

#include <string>
#include <vector>

#include "scene/capture.h"

namespace tessera {

// Sets Photo::split of `photos`, which stand in natural name order.
//   every:N    photo 0, N, 2N, ... are test, the others train
//   list:FILE  the photos named in FILE, one a line (path, file name, or name without extension), are test
//   none       all are train
// Throws Error for another word, and when nothing would be left to train on.
void holdOut(const std::string& rule, std::vector<Photo>& photos);

}  // namespace tessera
