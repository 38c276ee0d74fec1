#include "photogrammetry/model_folders.h"

#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "import/colmap_model.h"
#include "photogrammetry/colmap_program.h"

namespace tessera {

uint64_t statedCount(const fs::path& path) {
  uint64_t count = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file.read(reinterpret_cast<char*>(&count), sizeof count)) return 0;
  return count;
}

std::set<int> photosIn(const fs::path& folder) {
  std::set<int> photos;
  std::error_code status;
  if (!fs::exists(folder / "images.bin", status) || statedCount(folder / "points3D.bin") == 0) return photos;
  try {
    for (const ColmapModel::Image& image : readColmapModel(folder).images)
      photos.insert(static_cast<int>(image.id) - 1);
  } catch (const Error&) {
    photos.clear();
  }
  return photos;
}

std::vector<Piece> piecesIn(const fs::path& folder) {
  std::vector<Piece> pieces;
  std::error_code status;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, status)) {
    Piece piece{entry.path(), photosIn(entry.path())};
    if (!piece.photos.empty()) pieces.push_back(std::move(piece));
  }
  std::sort(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
    return a.photos.size() != b.photos.size() ? a.photos.size() > b.photos.size()
                                              : naturalLess(a.folder.string(), b.folder.string());
  });
  return pieces;
}

uint64_t statedPhotos(const fs::path& folder) {
  return statedCount(folder / "points3D.bin") > 0 ? statedCount(folder / "images.bin") : 0;
}

void requireWhole(const fs::path& folder) {
  const auto check = [](const fs::path& model) {
    std::error_code status;
    if (statedCount(model / "images.bin") == 0) return;
    // A model may have no points at all, as of a camera that only turns.
    const bool hasCount = fs::file_size(model / "points3D.bin", status) >= sizeof(uint64_t) && !status;
    if (hasCount && (statedCount(model / "points3D.bin") == 0 || !photosIn(model).empty())) return;
    throw ColmapKilled(model.string(), "", "was not written to its end",
                       "check free space and quota of the disk, and run again to go on");
  };
  check(folder);
  std::error_code status;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, status)) check(entry.path());
}

void removeFolder(const fs::path& folder) {
  // At once: whether a folder is there says whether something is finished.
  const fs::path discarded = fs::path(folder) += ".discarded";
  std::error_code status;
  fs::remove_all(discarded, status);
  if (fs::exists(folder, status)) fs::rename(folder, discarded, status);
  if (!status) fs::remove_all(discarded, status);
  if (status) throw Error(folder.string(), "", "cannot be removed: " + status.message(), "remove it");
}

void makeFolder(const fs::path& folder) {
  std::error_code status;
  fs::create_directories(folder, status);
  if (status) throw Error(folder.string(), "", "cannot be written: " + status.message(), "check the disk");
}

void replaceFolder(const fs::path& newFolder, const fs::path& target) {
  const fs::path before = fs::path(target) += ".before";
  std::error_code status;
  fs::remove_all(before, status);
  const bool hasTarget = fs::exists(target, status);
  if (hasTarget) fs::rename(target, before, status);
  if (!status) {
    fs::rename(newFolder, target, status);
    std::error_code ignored;
    if (status && hasTarget) fs::rename(before, target, ignored);
  }
  if (status) throw Error(target.string(), "", "cannot be written: " + status.message(), "check the disk");
  fs::remove_all(before, status);
}

}  // namespace tessera
