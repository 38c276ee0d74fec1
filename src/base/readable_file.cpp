#include "base/readable_file.h"

#include <unistd.h>

#include <cerrno>

#include "base/error.h"

namespace tessera {

bool meansAbsence(const std::error_code& error) {
  for (const std::errc code :
       {std::errc::no_such_file_or_directory, std::errc::not_a_directory, std::errc::permission_denied,
        std::errc::operation_not_permitted, std::errc::too_many_symbolic_link_levels, std::errc::filename_too_long})
    if (error == code) return true;
  return false;
}

bool isReadableFile(const fs::path& path) {
  std::error_code status;
  const bool isFile = fs::is_regular_file(path, status);
  if (isFile && ::access(path.c_str(), R_OK) != 0) status.assign(errno, std::generic_category());
  if (!status) return isFile;
  if (meansAbsence(status)) return false;
  throw Error(path.string(), "", "cannot be read: " + status.message(), "check the disk");
}

}  // namespace tessera
