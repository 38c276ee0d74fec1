#include "export/atomic_folder.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <string_view>

#include "base/error.h"

namespace tessera {
namespace {

Error couldNot(const fs::path& path, const std::error_code& status) {
  return Error(path.string(), "", "could not be written: " + status.message(), "check free space and permissions");
}

constexpr const char* kReplaced = "-old";  // ends the name of what is replaced, until that has been done

}  // namespace

void removeLeftovers(const fs::path& place) {
  const std::string prefix = place.filename().string() + ".partial-";
  std::error_code ignored;
  const fs::path parent = place.has_parent_path() ? place.parent_path() : fs::path(".");
  for (const fs::directory_entry& entry : fs::directory_iterator(parent, ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    int process = 0;
    const char* const end = name.data() + name.size();
    const auto [read, error] = std::from_chars(name.data() + prefix.size(), end, process);
    const std::string_view rest(read, static_cast<size_t>(end - read));
    if (error != std::errc() || process <= 0 || !(rest.empty() || rest == kReplaced || rest == kSpooled)) continue;
    if (::kill(process, 0) == 0 || errno != ESRCH) continue;
    // Of what was being replaced, nothing else may be left.
    if (rest == kReplaced && !fs::exists(place, ignored)) {
      fs::rename(entry.path(), place, ignored);
    } else {
      fs::remove_all(entry.path(), ignored);
    }
  }
}

AtomicFolder::AtomicFolder(const fs::path& place, const std::function<bool(const std::string& name)>& isOurs)
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
