#include "base/folder_size.h"

namespace tessera {

int64_t bytesBelow(const fs::path& folder) {
  int64_t bytes = 0;
  std::error_code status, ofFile;
  for (fs::recursive_directory_iterator at(folder, status), end; !status && at != end; at.increment(status)) {
    if (at->is_symlink(ofFile) || !at->is_regular_file(ofFile)) continue;
    if (at->hard_link_count(ofFile) != 1 || ofFile) continue;
    const uintmax_t size = at->file_size(ofFile);
    if (!ofFile) bytes += static_cast<int64_t>(size);
  }
  return bytes;
}

}  // namespace tessera
