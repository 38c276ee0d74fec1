#include "photogrammetry/photo_matches.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <thread>

#include "base/error.h"
#include "base/image_io.h"
#include "base/memory.h"
#include "base/threads.h"
#include "photogrammetry/colmap_database.h"
#include "photogrammetry/look_alikes.h"
#include "photogrammetry/photo_masks.h"

namespace tessera {
namespace {

constexpr size_t kPairsAtOnce =
    100;  // the program commits matches in large batches: what it has done is lost if killed
constexpr int kFewFeatures = 200;

void linkPhoto(const fs::path& photo, const fs::path& link) {
  std::error_code status;
  if (fs::is_symlink(link, status) && fs::read_symlink(link, status) == photo) return;
  fs::remove(link, status);
  fs::create_symlink(photo, link, status);
  if (status) throw Error(link.string(), "", "cannot be made: " + status.message(), "name a folder on another disk");
}

bool isTruncated(const fs::path& file) {
  try {
    return readImage(file).truncated;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

int64_t extractedPixels(const CameraBody& body) {
  constexpr double kLongest = 3200;
  const double factor = std::min(1.0, kLongest / std::max(body.width, body.height));
  return std::max(int64_t{1}, static_cast<int64_t>(factor * body.width * factor * body.height));
}

int64_t extractionBytes(int threads, int64_t pixels) {
  constexpr int64_t kBytesPerPixel = 370;  // about, measured
  return threads * kBytesPerPixel * std::max(pixels, int64_t{1});
}

int extractionThreads(int threads, int64_t pixels, int64_t memoryBytes) {
  constexpr double kShare = 0.7;  // of the memory: the rest is for other programs
  if (threads <= 0) threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  const auto each = static_cast<double>(extractionBytes(1, pixels));
  const double fitting = kShare * static_cast<double>(memoryBytes) / each;
  return fitting >= threads ? threads : std::max(1, static_cast<int>(fitting));
}

PhotoMatches::PhotoMatches(fs::path folder, const PhotoList& list, ColmapSettings settings)
    : folder_(std::move(folder)), list_(list), settings_(std::move(settings)) {}

void PhotoMatches::runColmap(const char* step, std::vector<std::string> arguments, const std::function<void()>& look,
                             const std::function<bool()>& isDone) {
  ColmapProgram colmap(folder_ / fmt::format("{}.log", step), settings_.program);
  colmap.run(std::move(arguments), look, isDone);
}

void PhotoMatches::discard() const {
  // The log of the database goes first: it would be replayed into a new one.
  for (const char* name : {"database.db-wal", "database.db-shm", "database.db", "images", "masks", "words.bin"}) {
    std::error_code status;
    fs::remove_all(folder_ / name, status);
    if (status) throw Error((folder_ / name).string(), "", "cannot be removed: " + status.message(), "remove it");
  }
}

void PhotoMatches::discardMatches() const {
  std::error_code status;
  if (fs::exists(database(), status)) ColmapDatabase(database()).removeMatches();
}

void PhotoMatches::extractFeatures(const Watch& watch) {
  std::error_code status;
  fs::create_directories(folder_ / "images", status);
  if (status) throw Error(folder_.string(), "", "cannot be made: " + status.message(), "name another folder");
  if (!fs::exists(database())) {
    const fs::path partial = folder_ / "database.partial.db";
    fs::remove(partial, status);
    runColmap("features", {"database_creator", "--database_path", partial.string()}, {});
    ColmapDatabase(partial).addPhotos(list_);
    fs::rename(partial, database(), status);
    if (status) throw Error(database().string(), "", "cannot be made: " + status.message(), "check the disk");
  }
  for (const ListedPhoto& photo : list_.photos)
    linkPhoto(fs::absolute(photo.file), folder_ / "images" / photo.safeName);
  const auto done = [&] { return static_cast<int64_t>(ColmapDatabase(database()).features().size()); };
  const auto count = static_cast<int64_t>(list_.photos.size());
  if (done() < count) {
    int64_t pixels = 0;
    for (const CameraBody& body : list_.bodies) pixels = std::max(pixels, extractedPixels(body));
    const int threads = extractionThreads(settings_.threads, pixels, availableMemoryBytes());
    std::vector<std::string> arguments{"feature_extractor",
                                       "--database_path",
                                       database().string(),
                                       "--image_path",
                                       (folder_ / "images").string(),
                                       "--SiftExtraction.use_gpu",
                                       "0",
                                       "--SiftExtraction.num_threads",
                                       std::to_string(threads)};
    ThreadPool pool(settings_.threads);
    if (writeMasks(list_, folder_ / "masks", pool, [&] { watch(0); }))
      arguments.insert(arguments.end(), {"--ImageReader.mask_path", (folder_ / "masks").string()});
    const auto extract = [&] {
      runColmap(
          "features", arguments, [&] { watch(done()); }, [&] { return done() == count; });
    };
    extract();
    // What could not be read then, it may read now.
    if (missesPhotos()) {
      extract();
      missesPhotos();
    }
  }
  int64_t features = 0;
  for (const auto& [photo, number] : ColmapDatabase(database()).features()) features += number;
  if (features == 0) {
    throw Error((folder_ / "images").string(), "", "no photo has features",
                "check that the photos show something sharp; features.log tells more");
  }
}

bool PhotoMatches::missesPhotos() const {
  const std::map<int, int> features = ColmapDatabase(database()).features();
  bool misses = false;
  for (int i = 0; i < static_cast<int>(list_.photos.size()); ++i) {
    if (features.contains(i)) continue;
    const Bytes file = readFile(list_.photos[static_cast<size_t>(i)].file);
    misses = misses || decodeImage(file).has_value();
  }
  return misses;
}

LookAlikes PhotoMatches::findLookAlikes(const std::vector<int>& photos, const Watch& watch) {
  // More words and photos make it slower than they improve it: a city of 202 photos takes a minute and a half of two
  // cores.
  constexpr int64_t kFeaturesPerWord = 40, kMinWords = 64, kMaxWords = 4096;
  constexpr size_t kPhotosForWords = 60;
  constexpr int kFeaturesOfPhoto = 1500;
  const fs::path words = folder_ / "words.bin", log = folder_ / "look_alikes.log";
  std::error_code status;
  if (!fs::exists(words, status)) {
    int64_t features = 0;
    const std::map<int, int> counts = ColmapDatabase(database()).features();
    for (const auto& [photo, count] : counts) features += count;
    const fs::path partial = folder_ / "words.partial.bin";
    runColmap("words",
              {"vocab_tree_builder", "--database_path", database().string(), "--vocab_tree_path", partial.string(),
               "--num_visual_words", std::to_string(std::clamp(features / kFeaturesPerWord, kMinWords, kMaxWords)),
               "--branching", "64", "--num_iterations", "5", "--max_num_images",
               std::to_string(std::min(kPhotosForWords, counts.size()))},
              [&] { watch(0); });
    fs::rename(partial, words, status);
    if (status) throw Error(words.string(), "", "cannot be made: " + status.message(), "check the disk");
  }
  fs::remove(log, status);
  const fs::path queries = folder_ / "queries.txt";
  std::string text;
  const std::map<int, int> features = ColmapDatabase(database()).features();
  for (const int photo : photos)
    if (features.contains(photo)) text += list_.photos[static_cast<size_t>(photo)].safeName + "\n";
  if (text.empty()) return LookAlikes(list_.photos.size());
  writeFileAtomically(queries, text);
  runColmap("look_alikes",
            {"vocab_tree_retriever", "--database_path", database().string(), "--vocab_tree_path", words.string(),
             "--query_image_list_path", queries.string(), "--num_images", std::to_string(kMaxLookAlikes + 1),
             "--max_num_features", std::to_string(kFeaturesOfPhoto)},
            [&] { watch(0); });
  return parseLookAlikes(readTextFile(log), list_);
}

void PhotoMatches::match(const std::vector<PhotoPair>& pairs, const Watch& watch) {
  const fs::path list = folder_ / "pairs.txt";
  const std::map<int, int> features = ColmapDatabase(database()).features();
  // Of some pairs, those that have not been compared. Photos without features cannot be.
  const auto notCompared = [&](auto begin, auto end) {
    std::vector<PhotoPair> missing;
    const auto known = ColmapDatabase(database()).inliers();
    std::copy_if(begin, end, std::back_inserter(missing), [&](const PhotoPair& pair) {
      return !known.contains(pair) && features.contains(pair.first) && features.contains(pair.second);
    });
    return missing;
  };
  const std::vector<PhotoPair> missing = notCompared(pairs.begin(), pairs.end());
  for (size_t begin = 0; begin < missing.size(); begin += kPairsAtOnce) {
    std::string text;
    const size_t end = std::min(missing.size(), begin + kPairsAtOnce);
    for (size_t i = begin; i < end; ++i) {
      text += fmt::format("{} {}\n", list_.photos[static_cast<size_t>(missing[i].first)].safeName,
                          list_.photos[static_cast<size_t>(missing[i].second)].safeName);
    }
    writeFileAtomically(list, text);
    runColmap(
        "matches",
        {"matches_importer", "--database_path", database().string(), "--match_list_path", list.string(), "--match_type",
         "pairs", "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads", settings_.threadsText()},
        [&] { watch(static_cast<int64_t>(pairs.size() - missing.size() + begin)); },
        [&] {
          const auto first = missing.begin();
          return notCompared(first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(end))
              .empty();
        });
    watch(static_cast<int64_t>(pairs.size() - missing.size() + end));
  }
  // Whatever the program reported.
  const size_t without = notCompared(pairs.begin(), pairs.end()).size();
  if (without > 0) {
    throw Error(database().string(), "",
                fmt::format("lacks {} of {} pairs after they were compared", without, pairs.size()),
                "see " + (folder_ / "matches.log").string() + "; run again to compare them");
  }
}

PhotoMatches::Counts PhotoMatches::count() const {
  Counts counts;
  std::error_code status;
  if (!fs::exists(database(), status)) return counts;
  const ColmapDatabase database(this->database());
  for (const auto& [photo, features] : database.features()) {
    ++counts.photos;
    counts.features += features;
  }
  for (const auto& [pair, inliers] : database.inliers()) {
    ++counts.pairs;
    counts.inliers += inliers;
  }
  return counts;
}

size_t PhotoMatches::linkedPairs() const {
  size_t linked = 0;
  for (const auto& [pair, inliers] : ColmapDatabase(database()).inliers()) linked += inliers > 0 ? 1 : 0;
  return linked;
}

std::vector<LeftOutPhoto> PhotoMatches::explain(const std::vector<int>& photos, const std::vector<int>& apart) const {
  const ColmapDatabase database(this->database());
  const std::map<int, int> features = database.features();
  std::map<int, int> links;
  for (const auto& [pair, inliers] : database.inliers()) {
    if (inliers == 0) continue;
    ++links[pair.first];
    ++links[pair.second];
  }
  constexpr int kMaxDecoded = 50;  // takes time
  int decoded = 0;
  std::vector<LeftOutPhoto> explained;
  for (const int i : photos) {
    const auto count = features.find(i);
    std::string reason = "not consistent with the others";
    const fs::path& file = list_.photos[static_cast<size_t>(i)].file;
    if (std::binary_search(apart.begin(), apart.end(), i)) {
      reason = kOfAnotherModel;
    } else if (count == features.end()) {
      reason = "not decodable";
    } else if (decoded++ < kMaxDecoded && isTruncated(file)) {
      reason = "truncated";
    } else if (count->second < kFewFeatures) {
      reason = "few features, as of water, sky or a blurred picture";
    } else if (!links.contains(i)) {
      reason = "nothing in common with another photo";
    }
    explained.push_back({list_.photos[static_cast<size_t>(i)].name, reason});
  }
  return explained;
}

}  // namespace tessera
