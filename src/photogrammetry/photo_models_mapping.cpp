// The steps of PhotoModels that run COLMAP's mapper.
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>

#include "base/error.h"
#include "base/log.h"
#include "photogrammetry/camera_motion.h"
#include "photogrammetry/colmap_database.h"
#include "photogrammetry/photo_models.h"

namespace tessera {
namespace {

constexpr int kPhotosPerSnapshot = 25;
constexpr size_t kKeptSnapshots = 2;  // the largest may be incomplete on the disk
constexpr int kLinkingInliers = 40;   // of a pair; photos that do not overlap were seen to have up to 37

constexpr const char* kNoModel = "failed to create sparse model";  // what the mapper says then

// Returns the end of a log.
std::string readEnd(const fs::path& log) {
  constexpr std::streamoff kTail = 1 << 14;
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  if (!file) return {};
  const std::streamoff size = file.tellg();
  std::string text(static_cast<size_t>(std::min(size, kTail)), '\0');
  file.seekg(size - static_cast<std::streamoff>(text.size()));
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  return text;
}

// Returns the number of photos that the mapper has registered last, from "Registering image #7 (3)" in its log.
int64_t lastRegistered(const fs::path& log) {
  const std::string text = readEnd(log);
  const size_t at = text.rfind("Registering image #");
  if (at == text.npos) return 0;
  const size_t open = text.find('(', at);
  return open == text.npos ? 0 : std::atoll(text.c_str() + open + 1);
}

// Whether the photos of a model see enough points to say how they stand, and those of a camera that moves.
bool isSupported(const Piece& piece) {
  constexpr uint64_t kLeastPerPhoto = 10;
  return statedCount(piece.folder / "points3D.bin") >= kLeastPerPhoto * piece.photos.size() &&
         !onlyTurns(readColmapModel(piece.folder));
}

// Removes all but the snapshots with the most photos: together, they would grow with the square of the number of
// photos. Their names are times that overflow, and say nothing.
void thinSnapshots(const fs::path& folder) {
  std::vector<std::pair<uint64_t, fs::path>> complete;
  std::error_code status;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, status)) {
    if (const uint64_t photos = statedPhotos(entry.path()); photos > 0) complete.emplace_back(photos, entry.path());
  }
  std::sort(complete.begin(), complete.end(), std::greater<>());
  for (size_t i = kKeptSnapshots; i < complete.size(); ++i) fs::remove_all(complete[i].second, status);
}

// Returns the number of models in a folder, of which the last one may not be written to its end.
size_t countBegun(const fs::path& models) {
  size_t count = 0;
  std::error_code status;
  for (const fs::directory_entry& entry : fs::directory_iterator(models, status))
    count += statedPhotos(entry.path()) > 0 ? 1 : 0;
  return count;
}

// Removes the snapshots of models that are finished; returns whether one is left to go on from.
bool dropSnapshots(const std::vector<Piece>& finished, const std::vector<fs::path>& snapshots) {
  constexpr size_t kOfTen = 9;  // photos: some may have been removed again; models share fewer
  bool isLeft = false;
  for (const fs::path& snapshot : snapshots) {
    const std::set<int> photos = photosIn(snapshot);
    const bool isOver = std::any_of(finished.begin(), finished.end(), [&](const Piece& piece) {
      const auto shared = std::count_if(photos.begin(), photos.end(), [&](int p) { return piece.photos.contains(p); });
      return 10 * static_cast<size_t>(shared) >= kOfTen * photos.size();
    });
    if (isOver) removeFolder(snapshot);
    isLeft = isLeft || !isOver;
  }
  return isLeft;
}

// Moves a model to a number that is free in a folder, and returns where it is then.
fs::path moveInto(const fs::path& model, const fs::path& models) {
  makeFolder(models);
  for (int i = 0;; ++i) {
    const fs::path place = models / std::to_string(i);
    if (fs::exists(place)) continue;
    fs::rename(model, place);
    return place;
  }
}

// Whether the mapper has come to its end, which it says last, with a model in a folder, or in a folder in it. It writes
// each model when that is finished.
bool hasFinished(const fs::path& folder, const fs::path& log) {
  const std::string text = readEnd(log);
  const size_t end = text.rfind("Elapsed time");
  return end != text.npos && text.find("Registering image", end) == text.npos &&
         (!photosIn(folder).empty() || !piecesIn(folder).empty());
}

// Going on from a model, the mapper writes one model into the folder itself, not into 0. Moves it there; returns
// whether there is one.
bool moveIntoSubfolder(const fs::path& folder) {
  if (photosIn(folder).empty()) return false;
  makeFolder(folder / "0");
  for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) fs::rename(folder / name, folder / "0" / name);
  return true;
}

}  // namespace

std::vector<std::string> PhotoModels::mapperArguments(const fs::path& output) const {
  return {"mapper", "--database_path", (folder_ / "database.db").string(), "--image_path",
          (folder_ / "images").string(), "--output_path", output.string(), "--Mapper.num_threads",
          settings_.threadsText(), "--Mapper.min_model_size", "3",
          // All poses are adjusted less often than by default; the stage `adjusting` does it in the end.
          "--Mapper.ba_global_function_tolerance", "1e-6", "--Mapper.ba_global_images_ratio", "1.2",
          "--Mapper.ba_global_points_ratio", "1.2", "--Mapper.ba_global_max_refinements", "2"};
}

void PhotoModels::runMapper(const fs::path& input, const fs::path& output, const std::set<int>& photos, bool resumes,
                            const Watch& watch) {
  const fs::path log = folder_ / "mapping.log", snapshots = folder_ / "snapshots", begun = folder_ / "snapshot.begun";
  std::error_code status;
  if (!resumes) fs::remove_all(begun, status);
  // The snapshot that an interrupted call went on from is kept until there is another one.
  if (const auto pieces = resumes ? piecesIn(snapshots) : std::vector<Piece>(); !pieces.empty()) {
    fs::remove_all(begun, status);
    fs::rename(pieces[0].folder, begun, status);
  }
  fs::remove_all(snapshots, status);
  fs::remove_all(output, status);
  fs::remove(log, status);
  makeFolder(output);
  makeFolder(snapshots);
  std::vector<std::string> arguments = mapperArguments(output);
  arguments.insert(arguments.end(), {"--Mapper.init_min_tri_angle", "8", "--Mapper.snapshot_path", snapshots.string(),
                                     "--Mapper.snapshot_images_freq", std::to_string(kPhotosPerSnapshot)});
  if (!photos.empty()) arguments.insert(arguments.end(), {"--image_list_path", writeNames("mapped.txt", photos)});
  const fs::path from = photosIn(begun).empty() ? input : begun;
  if (!from.empty()) arguments.insert(arguments.end(), {"--input_path", from.string()});
  size_t finished = 0;
  const auto look = [&] {
    // When a model is finished, the snapshots are of it, and larger than the first ones of the next.
    if (countBegun(output) > finished && piecesIn(output).size() > finished) {
      std::error_code ignored;  // the folder itself stays, as the mapper may write into it
      for (const fs::directory_entry& entry : fs::directory_iterator(snapshots, ignored))
        fs::remove_all(entry.path(), ignored);
      ++finished;
    }
    thinSnapshots(snapshots);
    watch(lastRegistered(log));
  };
  runColmap("mapping", std::move(arguments), look, [&] { return hasFinished(output, log); });
  requireWhole(output);
}

std::string PhotoModels::writeNames(const char* file, const std::set<int>& photos) const {
  std::string names;
  for (const int i : photos) names += list_.photos[static_cast<size_t>(i)].safeName + "\n";
  writeFileAtomically(folder_ / file, names);
  return (folder_ / file).string();
}

void PhotoModels::map(bool resumes, const Watch& watch) {
  // What the mapper has finished is kept until `join`: as `continued` if it went on from a snapshot, else as `whole`;
  // as `finished` while it is at the next model.
  const fs::path partial = folder_ / "sparse.partial", continued = folder_ / "sparse.continued",
                 whole = folder_ / "sparse.whole", finished = folder_ / "sparse.finished";
  const auto discardFinished = [&] {
    for (const fs::path& folder : {continued, whole, finished}) removeFolder(folder);
  };
  if (!resumes) discardFinished();
  if (!fs::exists(continued) && !fs::exists(whole)) {
    if (resumes) {
      moveIntoSubfolder(partial);
      for (const Piece& piece : piecesIn(partial)) moveInto(piece.folder, finished);
    }
    const std::vector<Piece> before = piecesIn(finished);
    std::vector<fs::path> snapshots;
    for (const Piece& piece : piecesIn(folder_ / "snapshots")) snapshots.push_back(piece.folder);
    if (!photosIn(folder_ / "snapshot.begun").empty()) snapshots.push_back(folder_ / "snapshot.begun");
    // Those that are left to map if no snapshot tells how.
    std::set<int> photos;
    const bool isAtNext = !before.empty() && !dropSnapshots(before, snapshots);
    if (isAtNext) photos = withMatched(notIn(before));
    bool wentOn = false;
    if (!isAtNext || photos.size() >= kLeastShared) {
      try {
        runMapper({}, partial, photos, resumes, watch);
      } catch (const Error&) {
        // Without any model, the mapper reports failure, too.
        if (readEnd(folder_ / "mapping.log").find(kNoModel) == std::string::npos) throw;
      }
      wentOn = moveIntoSubfolder(partial);
    }
    for (const Piece& piece : before) moveInto(piece.folder, partial);
    replaceFolder(partial, wentOn ? continued : whole);
    removeFolder(finished);
  }
  const bool wentOn = fs::exists(continued);
  removeFolder(partial);
  std::error_code status;
  fs::copy(wentOn ? continued : whole, partial, fs::copy_options::recursive, status);
  if (status) throw Error(partial.string(), "", "cannot be written: " + status.message(), "check the disk");
  mapRest(partial, wentOn, watch);
  for (const Piece& piece : piecesIn(partial))
    if (!isSupported(piece)) removeFolder(piece.folder);
  if (piecesIn(partial).empty()) {
    discardFinished();
    throw Error(
        folder_.string(), "", "no two photos could be placed relative to each other",
        "check that neighbouring photos overlap by more than half, are sharp, and were taken from different places");
  }
  replaceFolder(partial, folder_ / "sparse");
  // What came of the models before.
  discardAdjusted();
  discardJoined();
}

std::set<int> PhotoModels::withMatched(std::set<int> photos) const {
  const std::set<int> given = photos;
  for (const auto& [pair, inliers] : ColmapDatabase(folder_ / "database.db").inliers()) {
    if (inliers < kLinkingInliers || given.contains(pair.first) == given.contains(pair.second)) continue;
    photos.insert({pair.first, pair.second});
  }
  return photos;
}

std::set<int> PhotoModels::notIn(const std::vector<Piece>& pieces) const {
  std::set<int> photos;
  for (int i = 0; i < static_cast<int>(list_.photos.size()); ++i) photos.insert(i);
  for (const Piece& piece : pieces)
    for (const int photo : piece.photos) photos.erase(photo);
  return photos;
}

void PhotoModels::mapRest(const fs::path& models, bool withNeighbours, const Watch& watch) {
  const std::set<int> missing = notIn(piecesIn(models));
  const size_t placed = list_.photos.size() - missing.size();
  if (placed == 0 || missing.empty()) return;
  const Watch watchMore = [&](int64_t photos) { watch(static_cast<int64_t>(placed) + photos); };
  if (missing.size() >= kLeastShared) {
    const auto separate = mapOnly(models, withNeighbours ? withMatched(missing) : missing, {}, watchMore);
    for (const Piece& piece : separate) {
      if (!isSupported(piece)) {
        removeFolder(piece.folder);  // so that its photos do not count as placed below
        continue;
      }
      if (withNeighbours) continue;
      const std::set<int> linked = withMatched(piece.photos);
      if (linked.size() < piece.photos.size() + kLeastShared) continue;
      for (const Piece& larger : mapOnly(models, linked, {.model = piece.folder}, watchMore)) {
        const bool replaces = isSupported(larger) && larger.photos.size() >= piece.photos.size();
        removeFolder(replaces ? piece.folder : larger.folder);
      }
    }
  }
  mapLinked(models, watchMore);
}

void PhotoModels::mapLinked(const fs::path& models, const Watch& watch) {
  constexpr size_t kLinks = 3, kShareOfMany = 10;
  // Pairs with many inliers may be of photos from nearly one place, which begin no model: these are soon tried.
  constexpr size_t kMaxModels = 4, kMaxPairs = 12;
  const std::vector<Piece> pieces = piecesIn(models);
  if (!isSupported(pieces[0])) return;
  const std::set<int> missing = notIn(pieces);
  std::map<int, size_t> links;
  std::vector<std::pair<int, PhotoPair>> beginnings;
  for (const auto& [pair, inliers] : ColmapDatabase(folder_ / "database.db").inliers()) {
    const bool isFirst = missing.contains(pair.first), isSecond = missing.contains(pair.second);
    if (inliers < kLinkingInliers || (!isFirst && !isSecond)) continue;
    beginnings.emplace_back(inliers, pair);
    if (isFirst != isSecond) ++links[isFirst ? pair.first : pair.second];
  }
  std::set<int> linked;
  for (const auto& [photo, count] : links)
    if (count >= kLinks) linked.insert(photo);
  if (linked.empty() || linked.size() * kShareOfMany < list_.photos.size()) return;
  std::erase_if(beginnings, [&](const auto& beginning) {
    return !linked.contains(beginning.second.first) && !linked.contains(beginning.second.second);
  });
  std::sort(beginnings.begin(), beginnings.end(), std::greater<>());
  const std::set<int> photos = withMatched(linked);
  const auto countIn = [](const std::set<int>& some, const std::set<int>& all) {
    return static_cast<size_t>(std::count_if(some.begin(), some.end(), [&](int p) { return all.contains(p); }));
  };
  bool succeeded = false;
  size_t begun = 0;
  for (size_t i = 0; i < std::min(kMaxPairs, beginnings.size()) && begun < kMaxModels && !succeeded; ++i) {
    const std::vector<Piece> added = mapOnly(models, photos, {.pair = beginnings[i].second}, watch);
    begun += added.empty() ? 0 : 1;
    for (const Piece& piece : added) {
      // It must be the new largest one, or be possible to join with that.
      const bool isUseful =
          isSupported(piece) && 2 * countIn(linked, piece.photos) > linked.size() &&
          (countIn(piece.photos, pieces[0].photos) >= kLeastShared || piece.photos.size() > pieces[0].photos.size());
      if (!isUseful) removeFolder(piece.folder);
      succeeded = succeeded || isUseful;
    }
  }
}

std::vector<Piece> PhotoModels::mapOnly(const fs::path& models, const std::set<int>& photos, const Beginning& beginning,
                                        const Watch& watch) {
  const fs::path rest = folder_ / "rest.partial";
  removeFolder(rest);
  makeFolder(rest);
  const fs::path log = folder_ / "mapping.log";
  std::error_code status;
  fs::remove(log, status);
  std::vector<std::string> arguments = mapperArguments(rest);
  arguments.insert(arguments.end(), {"--image_list_path", writeNames("rest.txt", photos), "--Mapper.init_min_tri_angle",
                                     "4", "--Mapper.init_min_num_inliers", "50"});
  if (!beginning.model.empty()) arguments.insert(arguments.end(), {"--input_path", beginning.model.string()});
  if (const auto& pair = beginning.pair) {
    // Without the limit, all further models would begin with the same pair.
    arguments.insert(arguments.end(),
                     {"--Mapper.init_image_id1", std::to_string(pair->first + 1), "--Mapper.init_image_id2",
                      std::to_string(pair->second + 1), "--Mapper.max_num_models", "1"});
  }
  try {
    runColmap(
        "mapping", std::move(arguments), [&] { watch(lastRegistered(log)); }, [&] { return hasFinished(rest, log); });
    requireWhole(rest);
  } catch (const ColmapKilled&) {
    throw;
  } catch (const Error& error) {
    watch(lastRegistered(log));
    if (readEnd(log).find(kNoModel) == std::string::npos) warn("no further models: {}", error.what());
  }
  moveIntoSubfolder(rest);
  std::vector<Piece> added = piecesIn(rest);
  for (Piece& piece : added) piece.folder = moveInto(piece.folder, models);
  fs::remove_all(rest, status);
  return added;
}

}  // namespace tessera
