#include "export/whole_folder.h"

#include <unistd.h>

#include "base/error.h"

namespace tessera {
namespace {

Error couldNot(const fs::path& path, const std::error_code& status) {
  return Error(path.string(), "", "could not be written: " + status.message(), "check free space and permissions");
}

}  // namespace

WholeFolder::WholeFolder(const fs::path& place, const std::function<bool(const std::string& name)>& isOurs)
    : place_(place.has_filename() ? place : place.parent_path()) {
  beside_ = place_;
  beside_ += ".partial-" + std::to_string(::getpid());
  std::error_code status;
  if (fs::exists(place_, status)) {
    if (!fs::is_directory(place_, status)) {
      throw Error(place.string(), "", "is a file, not a folder", "name a folder to write");
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(place_, status)) {
      const std::string name = entry.path().filename().string();
      if (entry.is_regular_file(status) && isOurs(name)) continue;
      throw Error(place.string(), name, "is nothing that an export wrote, and would be lost", "name another folder");
    }
    if (status) throw Error(place.string(), "", status.message(), "check its permissions");
  }
  fs::remove_all(beside_, status);
  fs::create_directories(beside_, status);
  if (status) throw couldNot(place, status);
}

WholeFolder::~WholeFolder() {
  std::error_code ignored;
  fs::remove_all(beside_, ignored);
}

void WholeFolder::commit() {
  std::error_code status, ignored;
  fs::path old = place_;
  old += ".old-" + std::to_string(::getpid());
  const bool replaces = fs::exists(place_, status);
  if (replaces) fs::rename(place_, old, status);
  if (status) throw couldNot(place_, status);
  fs::rename(beside_, place_, status);
  if (status) {
    if (replaces) fs::rename(old, place_, ignored);
    throw couldNot(place_, status);
  }
  fs::remove_all(old, ignored);
}

}  // namespace tessera
