// A folder that one process at a time works in.
#pragma once

#include "base/child_process.h"
#include "base/file.h"

namespace tessera {

// Held until destruction, or until the process ends, however it does.
class FolderLock {
 public:
  // Creates the folder if it does not exist. Throws Error if another process holds it; warns where the disk knows no
  // locks.
  explicit FolderLock(const fs::path& folder);

 private:
  Descriptor file_;
};

}  // namespace tessera
