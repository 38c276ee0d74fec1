#include "photogrammetry/reconstruction.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>

#include "base/error.h"
#include "import/colmap_model.h"
#include "photogrammetry/colmap_database.h"
#include "photogrammetry/colmap_program.h"

namespace tessera {
namespace {

constexpr size_t kPairsAtOnce =
    100;  // the program commits matches in large batches: what it has done is lost if killed

// Returns the number of photos that the mapper has registered last, from "Registering image #7 (3)" in its log.
int64_t lastRegistered(const fs::path& log) {
  constexpr uint64_t kTail = 1 << 16;
  std::error_code status;
  const uint64_t size = fs::file_size(log, status);
  if (status) return 0;
  std::string text = readTextFile(log);
  if (size > kTail) text = text.substr(text.size() - kTail);
  const size_t at = text.rfind("Registering image #");
  if (at == text.npos) return 0;
  const size_t open = text.find('(', at);
  return open == text.npos ? 0 : std::atoll(text.c_str() + open + 1);
}

constexpr int kPhotosPerSnapshot = 25;
constexpr int kFewFeatures = 200;

bool saysNoModel(const fs::path& log) {
  return readTextFile(log).find("failed to create sparse model") != std::string::npos;
}

// Returns the number of photos of a model that is complete; 0 of one that was not written to its end.
size_t photosOfModel(const fs::path& folder) {
  std::error_code status;
  if (!fs::exists(folder / "images.bin", status) || !fs::exists(folder / "points3D.bin", status)) return 0;
  try {
    return readColmapModel(folder).images.size();
  } catch (const Error&) {
    return 0;
  }
}

bool isReadable(const fs::path& folder) {
  return photosOfModel(folder) > 0;
}

// Returns the folder of the model with the most photos among those in a folder.
std::optional<fs::path> largestIn(const fs::path& folder) {
  std::optional<fs::path> largest;
  size_t most = 0;
  std::error_code status;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, status)) {
    const size_t photos = photosOfModel(entry.path());
    if (photos <= most) continue;
    most = photos;
    largest = entry.path();
  }
  return largest;
}

void linkPhoto(const fs::path& photo, const fs::path& link) {
  std::error_code status;
  if (fs::is_symlink(link, status) && fs::read_symlink(link, status) == photo) return;
  fs::remove(link, status);
  fs::create_symlink(photo, link, status);
  if (status) throw Error(link.string(), "", "cannot be made: " + status.message(), "name a folder on another disk");
}

}  // namespace

Reconstruction::Reconstruction(fs::path folder, const PhotoList& list, ReconstructionOptions options)
    : folder_(std::move(folder)), list_(list), options_(std::move(options)) {}

std::string Reconstruction::threads() const {
  return options_.threads > 0 ? std::to_string(options_.threads) : "-1";
}

void Reconstruction::runColmap(const char* step, std::vector<std::string> arguments,
                               const std::function<void()>& look) {
  ColmapProgram colmap(folder_ / fmt::format("{}.log", step), options_.colmap);
  colmap.run(std::move(arguments), look);
  peakBytes_ = std::max(peakBytes_, colmap.peakBytes());
}

void Reconstruction::discardFeatures() const {
  // The log of the database goes first: it would be replayed into a new one.
  for (const char* name :
       {"database.db-wal", "database.db-shm", "database.db", "snapshots", "sparse.begun", "images"}) {
    std::error_code status;
    fs::remove_all(folder_ / name, status);
    if (status) throw Error((folder_ / name).string(), "", "cannot be removed: " + status.message(), "remove it");
  }
}

void Reconstruction::makeFolder() const {
  std::error_code status;
  fs::create_directories(folder_ / "images", status);
  if (status) throw Error(folder_.string(), "", "cannot be made: " + status.message(), "name another folder");
}

void Reconstruction::extractFeatures(const Watch& watch) {
  makeFolder();
  const fs::path database = folder_ / "database.db";
  if (!fs::exists(database)) {
    const fs::path partial = folder_ / "database.partial.db";
    std::error_code status;
    fs::remove(partial, status);
    runColmap("features", {"database_creator", "--database_path", partial.string()}, {});
    ColmapDatabase(partial).addPhotos(list_);
    fs::rename(partial, database, status);
    if (status) throw Error(database.string(), "", "cannot be made: " + status.message(), "check the disk");
  }
  for (const ListedPhoto& photo : list_.photos)
    linkPhoto(fs::absolute(photo.file), folder_ / "images" / photo.safeName);
  const auto done = [&] { return static_cast<int64_t>(ColmapDatabase(database).features().size()); };
  const auto count = static_cast<int64_t>(list_.photos.size());
  if (done() < count) {
    runColmap("features",
              {"feature_extractor", "--database_path", database.string(), "--image_path", (folder_ / "images").string(),
               "--SiftExtraction.use_gpu", "0", "--SiftExtraction.num_threads", threads()},
              [&] { watch(done()); });
  }
  if (done() == 0) throw Error(folder_.string(), "database.db", "no photo has features", "see features.log beside it");
}

void Reconstruction::match(const std::vector<PhotoPair>& pairs, const Watch& watch) {
  const fs::path file = folder_ / "database.db", list = folder_ / "pairs.txt";
  std::vector<PhotoPair> missing;
  const auto known = ColmapDatabase(file).inliers();
  std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(missing),
               [&](const PhotoPair& pair) { return !known.contains(pair); });
  for (size_t begin = 0; begin < missing.size(); begin += kPairsAtOnce) {
    std::string text;
    for (size_t i = begin; i < std::min(missing.size(), begin + kPairsAtOnce); ++i) {
      text += fmt::format("{} {}\n", list_.photos[static_cast<size_t>(missing[i].first)].safeName,
                          list_.photos[static_cast<size_t>(missing[i].second)].safeName);
    }
    writeFileAtomically(list, text);
    runColmap("matches",
              {"matches_importer", "--database_path", file.string(), "--match_list_path", list.string(), "--match_type",
               "pairs", "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads", threads()},
              {});
    watch(static_cast<int64_t>(pairs.size() - missing.size() + std::min(missing.size(), begin + kPairsAtOnce)));
  }
}

size_t Reconstruction::linkedPairs() const {
  size_t linked = 0;
  for (const auto& [pair, inliers] : ColmapDatabase(folder_ / "database.db").inliers()) linked += inliers > 0 ? 1 : 0;
  return linked;
}

void Reconstruction::runMapper(const fs::path& input, const fs::path& output, const Watch& watch) {
  const fs::path log = folder_ / "mapping.log", snapshots = folder_ / "snapshots";
  std::error_code status;
  fs::remove(log, status);
  fs::remove_all(output, status);
  fs::create_directories(output, status);
  fs::create_directories(snapshots, status);
  std::vector<std::string> arguments{"mapper",
                                     "--database_path",
                                     (folder_ / "database.db").string(),
                                     "--image_path",
                                     (folder_ / "images").string(),
                                     "--output_path",
                                     output.string(),
                                     "--Mapper.num_threads",
                                     threads(),
                                     "--Mapper.min_model_size",
                                     "3",
                                     "--Mapper.init_min_tri_angle",
                                     "8",
                                     "--Mapper.ba_global_function_tolerance",
                                     "1e-6",
                                     "--Mapper.ba_global_images_ratio",
                                     "1.2",
                                     "--Mapper.ba_global_points_ratio",
                                     "1.2",
                                     "--Mapper.ba_global_max_refinements",
                                     "2",
                                     "--Mapper.snapshot_path",
                                     snapshots.string(),
                                     "--Mapper.snapshot_images_freq",
                                     std::to_string(kPhotosPerSnapshot)};
  if (!input.empty()) arguments.insert(arguments.end(), {"--input_path", input.string()});
  runColmap("mapping", std::move(arguments), [&] { watch(lastRegistered(log)); });
}

void Reconstruction::replaceModels(const fs::path& models) const {
  const fs::path sparse = folder_ / "sparse", before = folder_ / "sparse.before";
  std::error_code status;
  fs::remove_all(before, status);
  if (fs::exists(sparse, status)) fs::rename(sparse, before, status);
  fs::rename(models, sparse, status);
  if (status) throw Error(sparse.string(), "", "cannot be made: " + status.message(), "check the disk");
  fs::remove_all(before, status);
  fs::remove_all(folder_ / "snapshots", status);
  fs::remove_all(folder_ / "sparse.begun", status);
}

void Reconstruction::map(bool resumes, const Watch& watch) {
  makeFolder();
  const fs::path partial = folder_ / "sparse.partial", begun = folder_ / "sparse.begun";
  std::error_code status;
  if (!resumes) fs::remove_all(begun, status);
  // The names of snapshots are times that overflow: the one with the most photos is the last. It is kept until the
  // next.
  if (const auto last = resumes ? largestIn(folder_ / "snapshots") : std::nullopt) {
    fs::remove_all(begun, status);
    fs::rename(*last, begun, status);
  }
  fs::remove_all(folder_ / "snapshots", status);
  try {
    runMapper(isReadable(begun) ? begun : fs::path(), partial, watch);
  } catch (const Error&) {
    // Without any model, the mapper reports failure, too.
    if (!saysNoModel(folder_ / "mapping.log")) throw;
  }
  if (!isReadable(partial) && !largestIn(partial)) {
    throw Error(folder_.string(), "", "no two photos could be placed relative to each other",
                "check that neighbouring photos overlap by more than half, and are sharp");
  }
  replaceModels(partial);
}

void Reconstruction::extendMap(const Watch& watch) {
  const std::optional<fs::path> model = findColmapModel(folder_);
  if (!model) return;
  const fs::path partial = folder_ / "sparse.partial";
  runMapper(*model, partial, watch);
  std::error_code status;
  if (photosOfModel(partial) >= photosOfModel(*model)) replaceModels(partial);
  fs::remove_all(partial, status);
}

std::vector<int> Reconstruction::placed() const {
  std::vector<int> photos;
  const std::optional<fs::path> model = findColmapModel(folder_);
  if (!model) return photos;
  for (const ColmapModel::Image& image : readColmapModel(*model).images)
    photos.push_back(static_cast<int>(image.id) - 1);
  std::sort(photos.begin(), photos.end());
  return photos;
}

std::vector<int> Reconstruction::unplacedPhotos() const {
  const std::vector<int> inModel = placed();
  std::vector<int> missing;
  for (int i = 0; i < static_cast<int>(list_.photos.size()); ++i) {
    if (!std::binary_search(inModel.begin(), inModel.end(), i)) missing.push_back(i);
  }
  return missing;
}

std::vector<LeftOutPhoto> Reconstruction::unplaced() const {
  const ColmapDatabase database(folder_ / "database.db");
  const std::map<int, int> features = database.features();
  std::map<int, int> links;
  for (const auto& [pair, inliers] : database.inliers()) {
    if (inliers == 0) continue;
    ++links[pair.first];
    ++links[pair.second];
  }
  std::vector<LeftOutPhoto> photos;
  for (const int i : unplacedPhotos()) {
    const auto count = features.find(i);
    std::string reason = "not consistent with the others";
    if (count == features.end()) {
      reason = "not decodable";
    } else if (count->second < kFewFeatures) {
      reason = "few features, as of water, sky or a blurred picture";
    } else if (!links.contains(i)) {
      reason = "nothing in common with another photo";
    }
    photos.push_back({list_.photos[static_cast<size_t>(i)].name, reason});
  }
  return photos;
}

SourceCapture Reconstruction::largestModel() const {
  const std::optional<fs::path> model = findColmapModel(folder_);
  if (!model) throw Error((folder_ / "sparse").string(), "", "holds no model", "run the stage `mapping` again");
  // The links in `images` lead out of that folder, which would be refused: photos get their own paths below.
  SourceCapture source = captureFromColmap(readColmapModel(*model), folder_ / "named");
  source.flight.assign(source.capture.photos.size(), 0);
  std::map<std::string, const ListedPhoto*> bySafeName;
  for (const ListedPhoto& photo : list_.photos) bySafeName[photo.safeName] = &photo;
  for (Photo& photo : source.capture.photos) {
    const auto listed = bySafeName.find(photo.image.filename().string());
    if (listed == bySafeName.end()) continue;
    photo.name = listed->second->name;
    photo.image = fs::absolute(listed->second->file);
    photo.gps = listed->second->tags.gps;
    source.flight[static_cast<size_t>(&photo - source.capture.photos.data())] = listed->second->flight;
  }
  return source;
}

}  // namespace tessera
