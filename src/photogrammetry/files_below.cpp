#include "photogrammetry/files_below.h"

#include <set>

#include "base/error.h"
#include "base/readable_file.h"

namespace tessera {

std::vector<fs::path> filesBelow(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code status;
  fs::recursive_directory_iterator at(folder, fs::directory_options::follow_directory_symlink, status), end;
  fs::path last = folder;
  std::set<fs::path> seen{fs::weakly_canonical(folder)};
  for (; !status && at != end; at.increment(status)) {
    last = at->path();
    const std::string name = last.filename().string();
    // Network drives by Synology store their previews in @eaDir.
    const bool isHidden = name.starts_with(".") || name == "@eaDir";
    std::error_code ignored;
    if (at->is_directory(ignored) && (isHidden || !seen.insert(fs::weakly_canonical(last, ignored)).second))
      at.disable_recursion_pending();
    std::error_code ofFile;
    if (!isHidden && at->is_regular_file(ofFile)) files.push_back(last);
    if (!isHidden && ofFile && !meansAbsence(ofFile))
      throw Error(last.string(), "", "cannot be read: " + ofFile.message(), "check the disk");
  }
  if (status) throw Error(last.string(), "", "cannot be listed: " + status.message(), "make it readable, or remove it");
  return files;
}

}  // namespace tessera
