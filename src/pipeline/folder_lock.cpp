#include "pipeline/folder_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"
#include "base/log.h"

namespace tessera {

FolderLock::FolderLock(const fs::path& folder) {
  std::error_code status;
  fs::create_directories(folder, status);
  const fs::path file = folder / "lock";
  file_.reset(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (file_.get() < 0) throw Error(file.string(), "", std::strerror(errno), "name a folder that can be written to");
  if (::flock(file_.get(), LOCK_EX | LOCK_NB) == 0) {
    if (readTextFile(file).find_first_not_of("0123456789\n") != std::string::npos)
      throw Error(file.string(), "", "was not made by such a run, and would be replaced",
                  "name another folder to write to");
    const std::string number = fmt::format("{}\n", ::getpid());
    if (::ftruncate(file_.get(), 0) == 0) [[maybe_unused]]
      const auto written = ::write(file_.get(), number.data(), number.size());
    return;
  }
  if (errno != EWOULDBLOCK) {
    warn("{}: this disk knows no locks ({}): no other run must work in the folder at the same time", file.string(),
         std::strerror(errno));
    return;
  }
  std::string other = readTextFile(file);
  while (!other.empty() && other.back() == '\n') other.pop_back();
  throw Error(folder.string(), "", fmt::format("process {} is working in this folder", other.empty() ? "?" : other),
              "wait for it, or end it");
}

}  // namespace tessera
