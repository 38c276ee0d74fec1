// Opens untrusted bytes as COLMAP's database.
#include <unistd.h>

#include "base/error.h"
#include "photogrammetry/colmap_database.h"
#include "photogrammetry/look_alikes.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  static const fs::path file = fs::temp_directory_path() / ("tessera-fuzz-" + std::to_string(::getpid()) + ".db");
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    writeFileAtomically(file, text);
    ColmapDatabase database(file);
    database.features();
    database.inliers();
    database.removeMatches();
  } catch (const Error&) {
  }
  std::error_code ignored;
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) fs::remove(fs::path(file) += suffix, ignored);
  PhotoList list;
  for (int i = 0; i < 3; ++i) {
    list.photos.emplace_back();
    list.photos.back().safeName = "p" + std::to_string(i);
  }
  parseLookAlikes(text, list);
  return 0;
}
