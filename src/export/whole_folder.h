// A folder that appears whole or not at all: written beside its place and renamed.
#pragma once

#include <functional>
#include <string>

#include "base/file.h"

namespace tessera {

class WholeFolder {
 public:
  // Removes what was left beside `place` by processes that were killed.
  // Throws Error where `place` is something that may not be replaced: a file, or a folder that holds anything which is
  // not a file that `isOurs` by its name.
  WholeFolder(const fs::path& place, const std::function<bool(const std::string& name)>& isOurs);
  ~WholeFolder();  // without commit, nothing is left
  WholeFolder(const WholeFolder&) = delete;

  const fs::path& path() const { return beside_; }  // to write into
  void commit();                                    // what stood there before is gone then

 private:
  fs::path place_, beside_;
};

}  // namespace tessera
