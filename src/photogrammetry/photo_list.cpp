#include "photogrammetry/photo_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <tuple>

#include "base/error.h"
#include "base/file_digest.h"
#include "base/image_codecs.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/readable_file.h"
#include "import/clean.h"
#include "photogrammetry/files_below.h"

namespace tessera {
namespace {

constexpr double kFullFrameWidth = 36;  // millimetres

struct Header {
  int width = 0, height = 0;  // 0: unreadable
  uint64_t fileBytes = 0, hash = 0;
  PhotoTags tags;
};

uint64_t contentHash(std::span<const std::byte> bytes) {
  uint64_t hash = 0xcbf29ce484222325;
  for (const std::byte value : bytes) hash = (hash ^ std::to_integer<uint64_t>(value)) * 0x100000001b3;
  return hash;
}

std::string inLowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string extensionInLowerCase(const fs::path& path) {
  return inLowerCase(path.extension().string());
}

// Photos in formats that only other programs read.
bool isOtherFormat(const fs::path& path) {
  static const std::set<std::string> extensions{".arw", ".avif", ".cr2", ".cr3", ".dng", ".heic", ".heif", ".jp2",
                                                ".nef", ".orf",  ".raf", ".rw2", ".tif", ".tiff", ".webp"};
  return extensions.contains(extensionInLowerCase(path));
}

std::string stemInLowerCase(const fs::path& path) {
  return inLowerCase(path.stem().string());
}

// Removes pictures in other formats beside photos of the same name, such as raw ones.
void removeRawTwins(std::vector<fs::path>& files) {
  const auto place = [](const fs::path& file) { return (file.parent_path() / stemInLowerCase(file)).string(); };
  std::set<std::string> photos;
  for (const fs::path& file : files)
    if (isPhotoName(file)) photos.insert(place(file));
  std::erase_if(files, [&](const fs::path& file) { return !isPhotoName(file) && photos.contains(place(file)); });
}

std::vector<fs::path> photoFiles(const fs::path& folder) {
  std::vector<fs::path> files = filesBelow(folder);
  std::erase_if(files, [](const fs::path& file) { return !isPhotoName(file) && !isOtherFormat(file); });
  removeRawTwins(files);
  return files;
}

Header readHeader(const fs::path& file) {
  Header header;
  if (!isReadableFile(file)) return header;
  // What a disk or a network fails to give for now must not count as a photo that is missing.
  const Bytes head = readPhotoHead(file);
  std::error_code status;
  header.fileBytes = fs::file_size(file, status);
  header.hash = contentHash(head);
  const auto info = probeImage(head);
  if (!info || info->format == ImageInfo::Format::exr) return header;
  // Of a size that a few bytes cannot contain; other programs would take the memory for it.
  if (!image_codecs::isPlausible(info->width, info->height, header.fileBytes, {})) return header;
  header.width = info->width;
  header.height = info->height;
  header.tags = decodePhotoTags(head);
  return header;
}

// Returns whether each file is a smaller copy of another one: the same name elsewhere, taken by the same camera at the
// same time and place. Those of the same size may be of several cameras that release together.
std::vector<bool> findCopies(const std::vector<fs::path>& files, const std::vector<Header>& headers) {
  using Key = std::tuple<std::string, std::string, std::string, std::string, double, double, double, bool, int>;
  std::map<Key, std::vector<size_t>> alike;
  for (size_t i = 0; i < files.size(); ++i) {
    const Header& header = headers[i];
    const CameraTags& camera = header.tags.camera;
    if (header.width == 0 || !header.tags.takenAt) continue;
    const GpsFix gps = header.tags.gps.value_or(GpsFix());
    const int shape = static_cast<int>(std::lround(10.0 * header.width / header.height));
    alike[Key(stemInLowerCase(files[i]), camera.make, camera.model, camera.serial, *header.tags.takenAt, gps.latitude,
              gps.longitude, camera.isThermal, shape)]
        .push_back(i);
  }
  std::vector<bool> isCopy(files.size());
  for (const auto& [key, group] : alike) {
    int width = 0;
    for (const size_t i : group) width = std::max(width, headers[i].width);
    for (const size_t i : group) isCopy[i] = headers[i].width < width;
  }
  return isCopy;
}

// Gives each photo a name without folders, blanks and characters that mean something to other programs.
std::string makeSafe(const std::string& name, std::set<std::string>& used) {
  std::string safe = name;
  for (char& c : safe) {
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-' && c != '_') c = '_';
  }
  // Room for a number: file systems allow 255 bytes.
  constexpr size_t kLongest = 200;
  if (safe.size() > kLongest) safe.erase(kLongest - 50, safe.size() - kLongest);
  const fs::path path(safe);
  for (int i = 2; !used.insert(safe).second; ++i)
    safe = fmt::format("{}_{}{}", path.stem().string(), i, path.extension().string());
  return safe;
}

std::string describe(const CameraTags& camera, int width, int height) {
  std::string name = camera.make;
  if (!camera.model.empty()) name += (name.empty() ? "" : " ") + camera.model;
  if (!camera.serial.empty()) name += " " + camera.serial;
  if (!camera.lens.empty()) name += ", " + camera.lens;
  return fmt::format("{}, {}x{}", name.empty() ? "unknown camera" : name, width, height);
}

// Returns the altitude from which a drone says that it took off.
std::optional<double> takeOffAltitude(const PhotoTags& tags) {
  if (!tags.gps || !tags.gps->hasAltitude || tags.gps->relativeAltitude == 0) return std::nullopt;
  return tags.gps->altitude - tags.gps->relativeAltitude;
}

constexpr size_t kTakeOffs = 3;  // photos that tell of a landing, on each side of it

// Whether a drone has landed between photos that state these altitudes of take-off. In flight, they stay as they are,
// or drift if the absolute altitude is not that of the barometer.
bool showLanding(const std::vector<double>& before, const std::vector<double>& after) {
  if (before.size() < kTakeOffs || after.size() < kTakeOffs) return false;
  const auto [lowest, highest] = std::minmax_element(before.begin(), before.end());
  const auto [laterLowest, laterHighest] = std::minmax_element(after.begin(), after.end());
  if (*highest - *lowest > kJumpBetweenFlights || *laterHighest - *laterLowest > kJumpBetweenFlights) return false;
  return std::max(*laterLowest - *highest, *lowest - *laterHighest) > kJumpBetweenFlights;
}

void findFlights(PhotoList& list) {
  std::vector<size_t> order(list.photos.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto folder = [&](size_t i) { return fs::path(list.photos[i].name).parent_path().string(); };
  // Zoom, and pictures that are upright, begin no flight.
  const auto group = [&](size_t i) {
    const ListedPhoto& photo = list.photos[i];
    const CameraBody& body = list.bodies[static_cast<size_t>(photo.body)];
    const CameraTags& camera = photo.tags.camera;
    return std::tuple(camera.make, camera.model, camera.serial, camera.lens, std::max(body.width, body.height),
                      std::min(body.width, body.height), photo.tags.takenAt.has_value(),
                      photo.tags.takenAt ? std::string() : folder(i));
  };
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return std::tuple(group(a), list.photos[a].tags.takenAt.value_or(0)) <
           std::tuple(group(b), list.photos[b].tags.takenAt.value_or(0));
  });
  const auto tags = [&](size_t k) -> const PhotoTags& { return list.photos[order[k]].tags; };
  const auto pauseBefore = [&](size_t k) { return tags(k).takenAt.value_or(0) - tags(k - 1).takenAt.value_or(0); };
  std::vector<bool> begins(order.size());  // whether a photo is the first of a flight whatever the altitudes
  for (size_t k = 0; k < order.size(); ++k)
    begins[k] = k == 0 || group(order[k - 1]) != group(order[k]) || pauseBefore(k) > kPauseBetweenFlights;
  std::vector<double> before;  // take-off altitudes of the last photos of a flight
  for (size_t k = 0; k < order.size(); ++k) {
    bool isNext = begins[k];
    if (!isNext && pauseBefore(k) > kShortestLanding && before.size() == kTakeOffs) {
      std::vector<double> after;
      for (size_t i = k; i < order.size() && after.size() < kTakeOffs && (i == k || !begins[i]); ++i)
        if (const auto altitude = takeOffAltitude(tags(i))) after.push_back(*altitude);
      isNext = showLanding(before, after);
    }
    if (isNext) {
      ++list.flights;
      before.clear();
    }
    list.photos[order[k]].flight = list.flights - 1;
    if (const auto altitude = takeOffAltitude(tags(k))) before.push_back(*altitude);
    if (before.size() > kTakeOffs) before.erase(before.begin());
  }
}

}  // namespace

bool isPhotoName(const fs::path& path) {
  const std::string extension = extensionInLowerCase(path);
  return extension == ".jpg" || extension == ".jpeg" || extension == ".png";
}

void warnLeftOut(const std::vector<LeftOutPhoto>& photos) {
  std::map<std::string, std::vector<std::string>> byReason;
  for (const LeftOutPhoto& photo : photos) byReason[photo.reason].push_back(photo.name);
  for (const auto& [reason, names] : byReason)
    warn("{} photo{} left out: {} ({})", names.size(), names.size() == 1 ? "" : "s", reason, abbreviateList(names));
}

double focalLengthInPixels(const CameraTags& camera, int width, int height) {
  const double longSide = std::max(width, height);
  const auto plausible = [longSide](double focal) {
    return focal > 0.3 * longSide && focal < 10 * longSide ? focal : 0;
  };
  if (camera.focalLength35 > 0) return plausible(camera.focalLength35 / kFullFrameWidth * longSide);
  // The resolution is that of the picture as the camera wrote it: of a reduced one, it gives too long a focal length.
  if (!(camera.recordedPixels > 0)) return 0;
  return plausible(camera.focalLength * camera.pixelsPerMillimetre * longSide / camera.recordedPixels);
}

bool isUtf8(const std::string& name) {
  try {
    nlohmann::json(name).dump();
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
  return true;
}

PhotoList listPhotos(const fs::path& folder, ThreadPool& pool) {
  std::vector<fs::path> files = photoFiles(folder);
  std::sort(files.begin(), files.end(),
            [](const fs::path& a, const fs::path& b) { return naturalLess(a.string(), b.string()); });
  std::vector<Header> headers(files.size());
  pool.run(files.size(), [&](size_t i, int) {
    if (isPhotoName(files[i])) headers[i] = readHeader(files[i]);
  });

  PhotoList list;
  std::map<std::string, int> bodies;
  std::map<std::pair<uint64_t, uint64_t>, fs::path> seen;
  std::set<std::string> safeNames;
  const bool hasVisible = std::any_of(headers.begin(), headers.end(),
                                      [](const Header& h) { return h.width > 0 && !h.tags.camera.isThermal; });
  const std::vector<bool> isCopy = findCopies(files, headers);
  for (size_t i = 0; i < files.size(); ++i) {
    const Header& header = headers[i];
    const std::string name = files[i].lexically_relative(folder).generic_string();
    if (!isUtf8(name)) {
      list.leftOut.push_back({name, "its name is not UTF-8; rename it"});
      continue;
    }
    if (isOtherFormat(files[i])) {
      list.leftOut.push_back({name, "in a format that is not read; convert it to JPEG"});
      continue;
    }
    if (header.width == 0) {
      list.leftOut.push_back({name, "not readable as JPEG or PNG"});
      continue;
    }
    if (header.tags.camera.isPanorama) {
      list.leftOut.push_back({name, "a panorama, whose lens is not supported"});
      continue;
    }
    if (header.tags.camera.isThermal && hasVisible) {
      list.leftOut.push_back({name, "infrared"});
      continue;
    }
    const auto [same, isNew] = seen.try_emplace({header.fileBytes, header.hash}, files[i]);
    if (!isNew && fileDigest(same->second) == fileDigest(files[i])) {
      list.leftOut.push_back({name, "the same file as another photo"});
      continue;
    }
    if (isCopy[i]) {
      list.leftOut.push_back({name, "a smaller copy of another photo"});
      continue;
    }
    const CameraTags& camera = header.tags.camera;
    CameraBody body{describe(camera, header.width, header.height), header.width, header.height,
                    focalLengthInPixels(camera, header.width, header.height)};
    const std::string key = fmt::format("{}/{:.3f}/{:.3f}", body.name, body.focalLength, camera.focalLength);
    const auto [index, isNewBody] = bodies.emplace(key, static_cast<int>(list.bodies.size()));
    if (isNewBody) list.bodies.push_back(std::move(body));
    list.photos.push_back({name, makeSafe(name, safeNames), files[i], index->second, 0, header.tags});
  }
  findFlights(list);
  return list;
}

}  // namespace tessera
