#include "base/file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "base/error.h"
#include "base/leftovers.h"

namespace tessera {
namespace {

// Opens the file without reading from it, and sets `size` to the size of the file.
std::ifstream openFile(const fs::path& path, uint64_t& size) {
  std::error_code status;
  if (fs::is_directory(path, status)) throw Error(path.string(), "", "is a folder, not a file", "name the file in it");
  std::ifstream in(path, std::ios::binary | std::ios::ate);
  if (!in) throw Error(path.string(), "", std::strerror(errno), "check the path and its permissions");
  size = static_cast<uint64_t>(std::max(in.tellg(), std::streampos(0)));
  in.seekg(0);
  return in;
}

template <class Container>
Container readBytes(std::ifstream& in, const fs::path& path, uint64_t bytes) {
  Container content;
  if (bytes > 0) {
    content.resize(bytes);
    in.read(reinterpret_cast<char*>(content.data()), static_cast<std::streamsize>(bytes));
  }
  if (!in) throw Error(path.string(), "", "could not be read to its end", "check the disk");
  return content;
}

template <class Container>
Container readWhole(const fs::path& path, uint64_t maxBytes) {
  uint64_t size = 0;
  std::ifstream in = openFile(path, size);
  if (size > maxBytes) {
    throw Error(path.string(), "",
                "has " + std::to_string(size) + " bytes, where " + std::to_string(maxBytes) +
                    " is the most that such a file may have",
                "check that it is the right file");
  }
  return readBytes<Container>(in, path, size);
}

[[noreturn]] void failWriting(const fs::path& path, const fs::path& partial) {
  const std::string reason = std::strerror(errno);
  std::error_code ignored;
  if (partial != path) fs::remove(partial, ignored);
  throw Error(path.string(), "", "could not be written: " + reason, "check free space and permissions");
}

}  // namespace

Bytes readFile(const fs::path& path, uint64_t maxBytes) {
  return readWhole<Bytes>(path, maxBytes);
}
std::string readTextFile(const fs::path& path, uint64_t maxBytes) {
  return readWhole<std::string>(path, maxBytes);
}

Bytes readFileStart(const fs::path& path, uint64_t bytes) {
  uint64_t size = 0;
  std::ifstream in = openFile(path, size);
  return readBytes<Bytes>(in, path, std::min(size, bytes));
}

void writeFileAtomically(const fs::path& path, std::span<const std::byte> bytes, bool durable) {
  std::error_code status, ofFolder;
  if (path.has_parent_path()) fs::create_directories(path.parent_path(), ofFolder);
  // A pipe or a device (/dev/stdout) is written to directly, because a rename would replace it.
  const bool isStream =
      fs::exists(path, status) && !fs::is_regular_file(path, status) && !fs::is_directory(path, status);
  const fs::path partial = isStream ? path : partialPlace(path);
  const int file = ::open(partial.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) {
    if (ofFolder) errno = ofFolder.value();  // why its folder is not there
    failWriting(path, partial);
  }
  size_t written = 0;
  while (written < bytes.size()) {
    const ssize_t count = ::write(file, bytes.data() + written, bytes.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      const int reason = errno;
      ::close(file);
      errno = reason;
      failWriting(path, partial);
    }
    written += static_cast<size_t>(count);
  }
  if (durable && !isStream && ::fsync(file) != 0) {
    const int reason = errno;
    ::close(file);
    errno = reason;
    failWriting(path, partial);
  }
  if (::close(file) != 0) failWriting(path, partial);
  if (!isStream && ::rename(partial.c_str(), path.c_str()) != 0) failWriting(path, partial);
}

void writeFileAtomically(const fs::path& path, std::string_view text, bool durable) {
  writeFileAtomically(path, std::as_bytes(std::span(text.data(), text.size())), durable);
}

std::optional<fs::path> resolveInside(const fs::path& root, std::string_view relative) {
  if (relative.empty() || relative.find('\0') != std::string_view::npos) return std::nullopt;
  const fs::path relativePath{std::string(relative)};
  if (relativePath.is_absolute()) return std::nullopt;
  std::error_code status;
  fs::path realRoot = fs::weakly_canonical(root.empty() ? "." : root, status);
  if (status) return std::nullopt;
  if (!realRoot.has_filename()) realRoot = realRoot.parent_path();  // "out/" that does not exist yet
  const fs::path real = fs::weakly_canonical(realRoot / relativePath, status);
  if (status) return std::nullopt;
  const auto [rootEnd, rest] = std::mismatch(realRoot.begin(), realRoot.end(), real.begin(), real.end());
  if (rootEnd != realRoot.end()) return std::nullopt;
  // weakly_canonical does not resolve a link whose target does not exist, but writing through it could leave `root`.
  for (fs::path part = real; part != realRoot && part.has_relative_path(); part = part.parent_path()) {
    if (fs::is_symlink(fs::symlink_status(part, status))) return std::nullopt;
  }
  return real;
}

bool naturalLess(std::string_view a, std::string_view b) {
  size_t i = 0, j = 0;
  const auto isDigit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  while (i < a.size() && j < b.size()) {
    if (isDigit(a[i]) && isDigit(b[j])) {
      size_t i0 = i, j0 = j;
      while (i0 < a.size() && a[i0] == '0') ++i0;
      while (j0 < b.size() && b[j0] == '0') ++j0;
      size_t i1 = i0, j1 = j0;
      while (i1 < a.size() && isDigit(a[i1])) ++i1;
      while (j1 < b.size() && isDigit(b[j1])) ++j1;
      if (i1 - i0 != j1 - j0) return i1 - i0 < j1 - j0;
      const int order = a.substr(i0, i1 - i0).compare(b.substr(j0, j1 - j0));
      if (order != 0) return order < 0;
      i = i1;
      j = j1;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
    }
  }
  if (a.size() - i != b.size() - j) return a.size() - i < b.size() - j;
  return a < b;
}

bool isNearlyFull(const fs::path& path) {
  constexpr uintmax_t kFew = 16 << 20;
  std::error_code status;
  const auto space = fs::space(path, status);
  return !status && space.available < kFew;
}

}  // namespace tessera
