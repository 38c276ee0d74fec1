#include "export/atomic_folder.h"

#include <fcntl.h>
#include <stdio.h>

#include <cerrno>

#include "base/error.h"
#include "base/leftovers.h"

namespace tessera {
namespace {

Error couldNot(const fs::path& path, const std::error_code& status) {
  return Error(path.string(), "", "could not be written: " + status.message(), "check free space and permissions");
}

}  // namespace

AtomicFolder::AtomicFolder(const fs::path& place, const std::function<bool(const std::string& name)>& isOurs)
    : place_(place.has_filename() ? place : place.parent_path()) {
  std::error_code status;
  // Of a symbolic link, what it leads to is replaced.
  if (const fs::path led = fs::canonical(place_, status); !status) place_ = led;
  beside_ = partialPlace(place_);
  if (fs::exists(place_, status)) {
    if (!fs::is_directory(place_, status)) {
      throw Error(place.string(), "", "is a file, not a folder", "name a folder to write");
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(place_, status)) {
      const std::string name = entry.path().filename().string();
      if (entry.is_regular_file(status) && isOurs(name)) continue;
      throw Error(place.string(), name, "was not written by an export and would be lost", "name another folder");
    }
    if (status) throw Error(place.string(), "", status.message(), "check its permissions");
  }
  removeLeftovers(place_);
  fs::remove_all(beside_, status);
  fs::create_directories(beside_, status);
  if (status) throw couldNot(place, status);
}

AtomicFolder::~AtomicFolder() {
  std::error_code ignored;
  fs::remove_all(beside_, ignored);
}

void AtomicFolder::commit() {
  std::error_code status;
  if (fs::exists(place_, status)) {
    // An atomic exchange: at every moment one of the two folders is at `place_`.
    if (::renameat2(AT_FDCWD, beside_.c_str(), AT_FDCWD, place_.c_str(), RENAME_EXCHANGE) == 0) {
      fs::remove_all(beside_, status);
      return;
    }
    // Some file systems do not support the exchange.
    if (errno != EINVAL && errno != ENOSYS && errno != ENOTSUP)
      throw couldNot(place_, std::error_code(errno, std::generic_category()));
    fs::path old = beside_;
    old += kReplaced;
    fs::remove_all(old, status);
    fs::rename(place_, old, status);
    if (!status) fs::rename(beside_, place_, status);
    if (status) {
      std::error_code ignored;
      if (!fs::exists(place_, ignored)) fs::rename(old, place_, ignored);
      throw couldNot(place_, status);
    }
    fs::remove_all(old, status);
    return;
  }
  fs::rename(beside_, place_, status);
  if (status) throw couldNot(place_, status);
}

}  // namespace tessera
