// An open file of a site. Its properties and its bytes are those of the file that was opened, even if its path leads to
// another file by now.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/file.h"

namespace tessera {

class SiteFile {
 public:
  struct Opening {
    std::shared_ptr<const SiteFile> file;  // null if there is no such file
    bool isBusy = false;                   // `file` is null because too many files are open
  };
  // Opens `folder / relative` for reading if it is a regular file below the folder, whose path must be canonical. Links
  // are followed, but must not end outside the folder or at a path with a part that begins with a dot. Other files
  // (pipes, devices) are not opened. Requires /proc.
  static Opening open(const fs::path& folder, const std::string& relative);

  SiteFile(const SiteFile&) = delete;
  SiteFile& operator=(const SiteFile&) = delete;
  ~SiteFile();

  const fs::path& path() const { return path_; }  // of the file, not of a link to it
  uint64_t bytes() const { return bytes_; }       // when it was opened
  // The entity tag, with its quotation marks, from size and modification time.
  const std::string& tag() const { return tag_; }

  // Fills `bytes` with the bytes of the file from `offset` on. Returns false if there are fewer, because the file has
  // been truncated.
  bool read(uint64_t offset, std::span<char> bytes) const;

 private:
  SiteFile(int descriptor, fs::path path, uint64_t bytes, std::string tag)
      : descriptor_(descriptor), path_(std::move(path)), bytes_(bytes), tag_(std::move(tag)) {}

  int descriptor_;
  fs::path path_;
  uint64_t bytes_;
  std::string tag_;
};

}  // namespace tessera
