// A file of a site, opened: what is said of it, and what is sent, is of this one, whatever its path leads to by then.
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
    std::shared_ptr<const SiteFile> file;  // nothing where there is no such file
    bool isBusy = false;                   // as this process, or the machine, has too many open
  };
  // Opens `folder / relative` to be read where what was opened is a plain file below the folder, which is canonical.
  // Links are followed and may lead anywhere but to a place outside, or to one with a part that begins with a dot. What
  // else a path leads to (a pipe, a device) is not touched. Needs /proc.
  static Opening open(const fs::path& folder, const std::string& relative);

  SiteFile(const SiteFile&) = delete;
  SiteFile& operator=(const SiteFile&) = delete;
  ~SiteFile();

  const fs::path& path() const { return path_; }   // of itself, not of a link to it
  uint64_t bytes() const { return bytes_; }        // when it was opened
  const std::string& tag() const { return tag_; }  // an entity tag with its quotation marks, of size and time

  // Fills `bytes` with those from `offset` on. False where there are fewer: the file has been cut off since.
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
