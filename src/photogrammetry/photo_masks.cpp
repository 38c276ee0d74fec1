#include "photogrammetry/photo_masks.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <optional>

#include "base/error.h"
#include "base/file_digest.h"
#include "base/image_io.h"
#include "base/log.h"
#include "import/colmap_model.h"
#include "import/photo_files.h"
#include "photogrammetry/files_below.h"

namespace tessera {
namespace {

constexpr const char* kImages = "images/";

std::string withoutImages(const std::string& name) {
  return name.starts_with(kImages) ? name.substr(std::string_view(kImages).size()) : name;
}

std::optional<ImageInfo> probe(const fs::path& file) {
  try {
    return probeImageFile(file);
  } catch (const Error&) {
    return std::nullopt;
  }
}

void checkSize(const fs::path& mask, const std::string& name, int width, int height) {
  const auto size = probe(mask);
  if (!size) throw Error(mask.string(), "", "cannot be read as PNG or JPEG", "write this mask again, or remove it");
  if (size->width == width && size->height == height) return;
  throw Error(mask.string(), "",
              fmt::format("is {} x {} pixels large, and its photo {} is {} x {}", size->width, size->height, name,
                          width, height),
              "give it the size of the photo");
}

}  // namespace

PhotoMasks::PhotoMasks(fs::path folder) : folder_(std::move(folder)) {
  std::error_code status;
  if (!fs::is_directory(folder_, status))
    throw Error("--masks " + folder_.string(), "", "is not a folder", "name the folder of masks");
}

std::string PhotoMasks::describe() const {
  std::vector<std::string> lines;
  for (const fs::path& file : filesBelow(folder_)) {
    if (isPhotoName(file))
      lines.push_back(file.lexically_relative(folder_).generic_string() + " " + fileDigest(file) + "\n");
  }
  std::sort(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line;
  return text;
}

fs::path PhotoMasks::find(const std::string& name, const fs::path& photo) const {
  // The folder is the user's own, so that links in it may lead anywhere; names may come from files.
  const fs::path relative = fs::path(name).lexically_normal();
  if (relative.is_absolute() || relative.empty() || *relative.begin() == "..") return {};
  for (const std::string& candidate : maskNames(relative.generic_string())) {
    const fs::path mask = folder_ / candidate;
    std::error_code status;
    if (fs::is_regular_file(mask, status)) return fs::equivalent(mask, photo, status) ? fs::path() : mask;
  }
  return {};
}

void PhotoMasks::report(size_t masks, const std::vector<std::string>& photos) const {
  if (masks == 0 && !photos.empty()) {
    const std::string name = withoutImages(photos.front());
    throw Error("--masks " + folder_.string(), "",
                fmt::format("has no mask of any photo: for {}, neither {}.png nor {} nor {} is there", photos.front(),
                            name, name, fs::path(name).replace_extension(".png").generic_string()),
                "name the masks like the photos");
  }
  inform("{} of {} photos have masks", masks, photos.size());
}

void PhotoMasks::addTo(PhotoList& list) const {
  size_t masks = 0;
  std::vector<std::string> names;
  for (ListedPhoto& photo : list.photos) {
    names.push_back(photo.name);
    photo.mask = find(photo.name, photo.file);
    if (photo.mask.empty()) continue;
    const CameraBody& body = list.bodies[static_cast<size_t>(photo.body)];
    checkSize(photo.mask, photo.name, body.width, body.height);
    ++masks;
  }
  report(masks, names);
}

void PhotoMasks::addTo(SourceCapture& source) const {
  size_t masks = 0;
  std::vector<std::string> names;
  std::vector<Photo>& photos = source.capture.photos;
  source.maskIsInverted.resize(photos.size(), false);
  for (size_t i = 0; i < photos.size(); ++i) {
    Photo& photo = photos[i];
    names.push_back(photo.name);
    fs::path mask = find(photo.name, photo.image);
    if (mask.empty()) mask = find(withoutImages(photo.name), photo.image);
    if (mask.empty()) continue;
    const auto size = probe(photo.image);
    if (!size) continue;  // it is dropped at import
    checkSize(mask, photo.name, size->width, size->height);
    photo.mask = mask;
    source.maskIsInverted[i] = false;
    ++masks;
  }
  report(masks, names);
}

bool writeMasks(const PhotoList& list, const fs::path& folder, ThreadPool& pool, const std::function<void()>& look) {
  std::vector<char> areThere(list.photos.size(), 0), areExcluded(list.photos.size(), 0);
  std::mutex looking;
  pool.run(list.photos.size(), [&](size_t i, int) {
    const ListedPhoto& photo = list.photos[i];
    if (photo.mask.empty()) return;
    if (look) {
      const std::lock_guard lock(looking);
      look();
    }
    const fs::path target = folder / (photo.safeName + ".png");
    std::error_code status;
    const bool isWritten = fs::exists(target, status);
    const ImageU8 mask = isWritten ? readImage(target).image : toMask(readImage(photo.mask).image, false);
    if (!isWritten) writePng(target, mask);
    areThere[i] = 1;
    areExcluded[i] = excludesAll(mask) ? 1 : 0;
  });
  std::vector<std::string> excluded;
  for (size_t i = 0; i < list.photos.size(); ++i)
    if (areExcluded[i] != 0) excluded.push_back(list.photos[i].name);
  if (!excluded.empty()) warnOfExcluded(excluded, list.photos.size(), "--masks");
  return std::find(areThere.begin(), areThere.end(), 1) != areThere.end();
}

}  // namespace tessera
