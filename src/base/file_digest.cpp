#include "base/file_digest.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "base/readable_file.h"

namespace tessera {

std::string fileDigest(const fs::path& path) {
  constexpr uint64_t kEnd = uint64_t{1} << 16;
  if (!isReadableFile(path)) return "-";
  std::error_code status;
  const uint64_t size = fs::file_size(path, status);
  std::ifstream in(path, std::ios::binary);
  const Error unreadable(path.string(), "", "could not be read to its end", "check the disk");
  if (status || !in) throw unreadable;
  uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  const auto add = [&hash](uint64_t value) { hash = (hash ^ value) * 0x100000001b3; };
  add(size);
  std::string part(kEnd, '\0');
  for (const uint64_t begin : {uint64_t{0}, std::max(kEnd, size - std::min(size, kEnd))}) {
    if (begin >= size) break;
    const uint64_t count = std::min(kEnd, size - begin);
    in.seekg(static_cast<std::streamoff>(begin));
    if (!in.read(part.data(), static_cast<std::streamsize>(count))) throw unreadable;
    for (uint64_t i = 0; i < count; ++i) add(static_cast<unsigned char>(part[i]));
  }
  return fmt::format("{:016x}", hash);
}

}  // namespace tessera
