#include "pipeline/run_estimator.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "base/error.h"
#include "base/order_statistics.h"
#include "import/holdout.h"
#include "pipeline/pairs_json.h"

namespace tessera {

RunEstimator::RunEstimator(const PhotoRunOptions& options, const PhotoList& list, const PhotoMatches& matches,
                           std::string photosDigest)
    : options_(options), list_(list), matches_(matches), photosDigest_(std::move(photosDigest)) {}

const MatchingRates& RunEstimator::rates() {
  if (rates_) return *rates_;
  const fs::path file = options_.out / "probe.json";
  const std::string key = fmt::format("{} {} threads", photosDigest_, options_.threads);
  rates_ = readRates(key);
  if (!rates_) {
    const auto stop = [this] {
      if (options_.interrupted()) throw RunInterrupted();
    };
    rates_ = measureMatchingRates(list_, options_.threads, options_.out / "probe", stop);
    writeFileAtomically(file, encodeMatchingRates(*rates_, key));
  }
  return *rates_;
}

// Those of a probe of these photos whose key begins in this way.
std::optional<MatchingRates> RunEstimator::readRates(const std::string& key) const {
  const fs::path file = options_.out / "probe.json";
  std::error_code status;
  return fs::exists(file, status) ? decodeMatchingRates(readTextFile(file), key) : std::nullopt;
}

// Rates for stages that need no COLMAP, which the machine that trains may lack: by order of magnitude, those of another
// number of threads, or of photos of this size.
MatchingRates RunEstimator::anyRates() {
  try {
    return rates();
  } catch (const ColmapKilled&) {
    throw;
  } catch (const Error&) {
    return readRates(photosDigest_ + " ").value_or(expectRates(list_));
  }
}

// The number of pairs that are compared, as far as it is known before the look-alikes are.
int64_t RunEstimator::expectedPairs() {
  constexpr double kPairsPerPhoto = 8;  // of look-alikes that are not neighbours: 5.6 and 7.7 were measured
  const fs::path file = options_.out / "poses/pairs.json";
  std::error_code status;
  if (expectedPairs_ == 0 && fs::exists(file, status)) {
    try {
      const ChosenPairs chosen = readPairs(file, list_.photos.size());
      if (chosen.photos == photosDigest_) expectedPairs_ = static_cast<int64_t>(chosen.pairs.size());
    } catch (const Error&) {  // of other photos, or damaged: they are chosen anew
    }
  }
  if (expectedPairs_ == 0) {
    expectedPairs_ = static_cast<int64_t>(choosePairs(list_, {}).size());
    expectedPairs_ += static_cast<int64_t>(kPairsPerPhoto * static_cast<double>(countForLookAlikes()));
  }
  return expectedPairs_;
}

int64_t RunEstimator::countForLookAlikes() {
  if (!forLookAlikes_) forLookAlikes_ = static_cast<int64_t>(photosForLookAlikes(list_).size());
  return *forLookAlikes_;
}

MatchingNeeds RunEstimator::matchingNeeds() {
  const PhotoMatches::Counts counts = matches_.count();
  MatchingSize size{
      .photos = static_cast<int64_t>(list_.photos.size()), .pairs = expectedPairs(), .threads = threads()};
  for (const CameraBody& body : list_.bodies) size.pixels = std::max(size.pixels, extractedPixels(body));
  size.forLookAlikes = countForLookAlikes();
  if (counts.photos == size.photos) {
    size.features = counts.features;
    if (counts.pairs >= size.pairs) size.inliers = counts.inliers;
  }
  return planMatching(size, rates());
}

StageNeeds RunEstimator::featureNeeds(bool resumes) {
  const double share = static_cast<double>(matches_.count().photos) / static_cast<double>(list_.photos.size());
  return withoutDone(matchingNeeds().features, resumes ? share : 0);
}

StageNeeds RunEstimator::matchNeeds(bool resumes) {
  const double share = static_cast<double>(matches_.count().pairs) / static_cast<double>(expectedPairs());
  return withoutDone(matchingNeeds().matches, resumes ? share : 0);
}

StageNeeds RunEstimator::lookAlikeNeeds() {
  return countForLookAlikes() > 0 ? matchingNeeds().lookAlikes : StageNeeds{};
}

StageNeeds RunEstimator::remappingNeeds(size_t missing, size_t pairs) {
  const MatchingNeeds needs = matchingNeeds();
  StageNeeds remapping = needs.mapping;
  remapping.seconds =
      needs.matches.seconds * static_cast<double>(pairs) / static_cast<double>(std::max<int64_t>(1, expectedPairs())) +
      needs.mapping.seconds * static_cast<double>(missing) / static_cast<double>(list_.photos.size()) +
      needs.adjusting.seconds;
  return remapping;
}

const TrainingSize& RunEstimator::trainingSize() {
  if (trainingSize_) return *trainingSize_;
  TrainingSize size{
      .photos = static_cast<int64_t>(list_.photos.size()), .minutes = options_.minutes, .steps = options_.steps};
  std::vector<Photo> photos(list_.photos.size());
  std::vector<int64_t> pixels;
  std::vector<int> sides;
  for (size_t i = 0; i < photos.size(); ++i) {
    std::error_code status;
    photos[i].name = list_.photos[i].name;
    const auto bytes = fs::file_size(list_.photos[i].file, status);
    size.sourceBytes += status ? 0 : static_cast<int64_t>(bytes);
    const CameraBody& body = list_.bodies[static_cast<size_t>(list_.photos[i].body)];
    pixels.push_back(int64_t{body.width} * body.height);
    sides.push_back(std::max(body.width, body.height));
  }
  holdOut(options_.holdout, photos);
  size.heldOut =
      std::count_if(photos.begin(), photos.end(), [](const Photo& photo) { return photo.split == Split::test; });
  size.photoPixels = size.sourcePixels = upperMedian(pixels);
  size.longerSide = upperMedian(sides);
  trainingSize_ = size;
  return *trainingSize_;
}

TrainingSize RunEstimator::trainingSize(int downscale) {
  TrainingSize size = trainingSize();
  size.photoPixels /= int64_t{downscale} * downscale;
  size.relativeSeconds = relativeSeconds(anyRates());
  size.threads = options_.threads;
  size.isLinked = downscale == 1 && areOnOneDisk(list_.photos.front().file, options_.out);
  return size;
}

int RunEstimator::threads() const {
  return options_.threads > 0 ? options_.threads : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

}  // namespace tessera
