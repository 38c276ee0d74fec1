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
  // The name by which the system knows what is open.
  std::string link() const { return fmt::format("/proc/self/fd/{}", number_); }

 private:
  int number_;
};

bool hasTooManyOpen() {
  return errno == EMFILE || errno == ENFILE;
}

// Where what is open lies now, without links.
std::optional<fs::path> pathOf(const Descriptor& open, const struct stat& status) {
  std::array<char, PATH_MAX> text;
  const ssize_t length = ::readlink(open.link().c_str(), text.data(), text.size());
  if (length <= 0 || static_cast<size_t>(length) == text.size()) return std::nullopt;
  std::string path(text.data(), static_cast<size_t>(length));
  // One that was replaced since it was found is served as what it was.
  constexpr std::string_view kDeleted = " (deleted)";
  if (status.st_nlink == 0 && path.ends_with(kDeleted)) path.resize(path.size() - kDeleted.size());
  return path;
}

// Without a part that begins with a dot on the way.
bool isBelow(const fs::path& file, const fs::path& folder) {
  const auto [end, inFile] = std::mismatch(folder.begin(), folder.end(), file.begin(), file.end());
  return end == folder.end() && inFile != file.end() &&
         std::none_of(inFile, file.end(), [](const fs::path& part) { return part.string().starts_with('.'); });
}

}  // namespace

SiteFile::Opening SiteFile::open(const fs::path& folder, const std::string& relative) {
  // Found first without being opened, as a pipe would wait and a device may act; then that very one, not its path
  // again.
  const Descriptor found(::open((folder / relative).c_str(), O_PATH | O_CLOEXEC));
  if (*found < 0) return {nullptr, hasTooManyOpen()};
  struct stat status;
  if (::fstat(*found, &status) != 0 || !S_ISREG(status.st_mode)) return {};
  auto path = pathOf(found, status);
  if (!path || !isBelow(*path, folder)) return {};
  Descriptor readable(::open(found.link().c_str(), O_RDONLY | O_CLOEXEC | O_NOCTTY));
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
