#include "base/file_digest.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

namespace tessera {

std::string fileDigest(const fs::path& path) {
  constexpr uint64_t kEnd = uint64_t{1} << 16;
  std::error_code status;
  const uint64_t size = fs::file_size(path, status);
  std::ifstream in(path, std::ios::binary);
  if (status || !in) return "-";
  uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  const auto add = [&hash](uint64_t value) { hash = (hash ^ value) * 0x100000001b3; };
  add(size);
  std::string part(kEnd, '\0');
  for (const uint64_t begin : {uint64_t{0}, std::max(kEnd, size - std::min(size, kEnd))}) {
    if (begin >= size) break;
    const uint64_t count = std::min(kEnd, size - begin);
    in.seekg(static_cast<std::streamoff>(begin));
    if (!in.read(part.data(), static_cast<std::streamsize>(count))) return "-";
    for (uint64_t i = 0; i < count; ++i) add(static_cast<unsigned char>(part[i]));
  }
  return fmt::format("{:016x}", hash);
}

}  // namespace tessera
