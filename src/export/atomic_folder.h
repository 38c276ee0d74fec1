// A folder that appears complete or not at all: it is written next to its final place and then renamed.
#pragma once

#include <functional>
#include <string>

#include "base/file.h"

namespace tessera {

class AtomicFolder {
 public:
  // Removes what killed processes left next to `place`. Throws Error if `place` is something that must not be replaced:
  // a file, or a folder that contains anything for whose name `isOurs` returns false.
  AtomicFolder(const fs::path& place, const std::function<bool(const std::string& name)>& isOurs);
  ~AtomicFolder();  // without commit(), nothing is left on disk
  AtomicFolder(const AtomicFolder&) = delete;

  const fs::path& path() const { return beside_; }  // the folder to write into
  void commit();  // replaces what was at `place`; throws Error if it cannot be replaced

 private:
  fs::path place_, beside_;
};

}  // namespace tessera
