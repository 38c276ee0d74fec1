#include "serve/site_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <climits>
#include <optional>
#include <utility>

namespace tessera {
namespace {

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int operator*() const { return number_; }
  int release() { return std::exchange(number_, -1); }
  // Returns the path by which the system refers to the open file.
  std::string link() const { return fmt::format("/proc/self/fd/{}", number_); }

 private:
  int number_;
};

bool hasTooManyOpen() {
  return errno == EMFILE || errno == ENFILE;
}

// Returns the current path of the open file, without links.
std::optional<fs::path> resolveOpenPath(const Descriptor& open, const struct stat& status) {
  std::array<char, PATH_MAX> text;
  const ssize_t length = ::readlink(open.link().c_str(), text.data(), text.size());
  if (length <= 0 || static_cast<size_t>(length) == text.size()) return std::nullopt;
  std::string path(text.data(), static_cast<size_t>(length));
  // A file that has been replaced since it was opened is served under its former path.
  constexpr std::string_view kDeleted = " (deleted)";
  if (status.st_nlink == 0 && path.ends_with(kDeleted)) path.resize(path.size() - kDeleted.size());
  return path;
}

// Returns whether the file lies below the folder, without a part that begins with a dot in between.
bool isBelow(const fs::path& file, const fs::path& folder) {
  const auto [end, inFile] = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
  return end == folder.end() && inFile != file.end() &&
         std::none_of(inFile, file.end(), [](const fs::path& part) { return part.string().starts_with('.'); });
}

}  // namespace

SiteFile::Opening SiteFile::open(const fs::path& folder, const std::string& relative) {
  // The path is first resolved without opening the file, because opening a pipe would block and opening a device may
  // have effects; then the same file is opened, through its descriptor rather than through its path again.
  const Descriptor pathHandle(::open((folder / relative).c_str(), O_PATH | O_CLOEXEC));
  if (*pathHandle < 0) return {nullptr, hasTooManyOpen()};
  struct stat status;
  if (::fstat(*pathHandle, &status) != 0 || !S_ISREG(status.st_mode)) return {};
  auto path = resolveOpenPath(pathHandle, status);
  if (!path || !isBelow(*path, folder)) return {};
  Descriptor readable(::open(pathHandle.link().c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY));
  if (*readable < 0) return {nullptr, hasTooManyOpen()};
  if (::fstat(*readable, &status) != 0) return {};
  const auto bytes = static_cast<uint64_t>(status.st_size);
  std::string tag = fmt::format("\"{:x}-{:x}.{:x}\"", bytes, status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
  return {std::shared_ptr<const SiteFile>(new SiteFile(readable.release(), std::move(*path), bytes, std::move(tag)))};
}

SiteFile::~SiteFile() {
  ::close(descriptor_);
}

bool SiteFile::read(uint64_t offset, std::span<char> bytes) const {
  while (!bytes.empty()) {
    const ssize_t count = ::pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    offset += static_cast<uint64_t>(count);
    bytes = bytes.subspan(static_cast<size_t>(count));
  }
  return true;
}

}  // namespace tessera
