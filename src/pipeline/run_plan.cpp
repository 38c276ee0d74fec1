#include "pipeline/run_plan.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "base/order_statistics.h"
#include "photogrammetry/frame_choice.h"
#include "photogrammetry/photo_matches.h"

namespace tessera {
namespace {

using Seconds = std::chrono::duration<double>;
using SteadyClock = std::chrono::steady_clock;

constexpr int64_t kMiB = 1 << 20;
constexpr double kSecondsPerMinute = 60;
constexpr size_t kProbed = 5;               // photos: ten pairs
constexpr size_t kFewestToProbe = 15;       // photos: of fewer, a probe is a large part of the task
constexpr double kFeatureSeconds = 1.4e-6;  // of two cores, for the features in a pixel (1.25 and 1.67 were measured)

// The photos from the middle of those of the most frequent camera, or of all if it has taken too few.
PhotoList photosToProbe(const PhotoList& list) {
  std::vector<size_t> counts(list.bodies.size());
  for (const ListedPhoto& photo : list.photos) ++counts[static_cast<size_t>(photo.body)];
  const auto body = static_cast<int>(std::max_element(counts.begin(), counts.end()) - counts.begin());
  std::vector<ListedPhoto> ofBody;
  std::copy_if(list.photos.begin(), list.photos.end(), std::back_inserter(ofBody),
               [body](const ListedPhoto& photo) { return photo.body == body; });
  if (ofBody.size() < kProbed) ofBody = list.photos;
  const size_t count = std::min(kProbed, ofBody.size());
  const auto begin = ofBody.begin() + static_cast<std::ptrdiff_t>((ofBody.size() - count) / 2);
  PhotoList chosen;
  chosen.bodies = list.bodies;
  chosen.photos.assign(begin, begin + static_cast<std::ptrdiff_t>(count));
  chosen.flights = list.flights;
  for (ListedPhoto& photo : chosen.photos) photo.mask.clear();  // which say nothing about the others
  return chosen;
}

MatchingRates probe(const PhotoList& chosen, int threads, const fs::path& folder, const std::function<void()>& look) {
  PhotoMatches matches(folder, chosen, {.threads = threads});
  const auto start = SteadyClock::now();
  matches.extractFeatures([&](int64_t) { look(); });
  const auto extracted = SteadyClock::now();
  std::vector<PhotoPair> pairs;
  const auto count = static_cast<int>(chosen.photos.size());
  for (int first = 0; first < count; ++first)
    for (int second = first + 1; second < count; ++second) pairs.emplace_back(first, second);
  matches.match(pairs, [&](int64_t) { look(); });
  const auto matched = SteadyClock::now();
  const PhotoMatches::Counts counts = matches.count();
  double pixels = 0;
  for (const ListedPhoto& photo : chosen.photos)
    pixels += static_cast<double>(extractedPixels(chosen.bodies[static_cast<size_t>(photo.body)])) / count;
  return {.secondsPerPhoto = Seconds(extracted - start).count() / count,
          .secondsPerPair = Seconds(matched - extracted).count() / static_cast<double>(pairs.size()),
          .pixelsPerPhoto = pixels,
          .featuresPerPhoto = static_cast<double>(counts.features) / count,
          .inliersPerPair = static_cast<double>(counts.inliers) / static_cast<double>(pairs.size())};
}

}  // namespace

MatchingRates expectRates(const PhotoList& list) {
  constexpr double kMaxFeatures = 8192;  // COLMAP's
  MatchingRates rates;
  std::vector<double> pixels;
  for (const ListedPhoto& photo : list.photos)
    pixels.push_back(static_cast<double>(extractedPixels(list.bodies[static_cast<size_t>(photo.body)])));
  const double size = upperMedian(pixels) / rates.pixelsPerPhoto;
  const double features = std::min(size, kMaxFeatures / rates.featuresPerPhoto);
  rates.secondsPerPhoto *= size;
  rates.pixelsPerPhoto *= size;
  for (double* number : {&rates.featuresPerPhoto, &rates.secondsPerPair, &rates.inliersPerPair}) *number *= features;
  return rates;
}

MatchingRates measureMatchingRates(const PhotoList& list, int threads, const fs::path& folder,
                                   const std::function<void()>& look) {
  ColmapProgram(folder / "probe.log");  // throws if there is none that can be used
  MatchingRates rates = expectRates(list);
  if (list.photos.size() < kFewestToProbe) return rates;
  std::error_code status;
  fs::remove_all(folder, status);
  fs::create_directories(folder, status);
  if (status) throw Error(folder.string(), "", "cannot be made: " + status.message(), "name another folder");
  try {
    inform("a few photos are tried, to tell how long all will take");
    rates = probe(photosToProbe(list), threads, folder, look);
  } catch (const ColmapKilled&) {
    throw;
  } catch (const Error& error) {
    warn("how long features and matches take is not known: {}", error.what());
  }
  fs::remove_all(folder, status);
  return rates;
}

std::string encodeMatchingRates(const MatchingRates& rates, const std::string& key) {
  const nlohmann::ordered_json json = {{"of", key},
                                       {"seconds_per_photo", rates.secondsPerPhoto},
                                       {"seconds_per_pair", rates.secondsPerPair},
                                       {"pixels_per_photo", rates.pixelsPerPhoto},
                                       {"features_per_photo", rates.featuresPerPhoto},
                                       {"inliers_per_pair", rates.inliersPerPair}};
  return json.dump(2) + "\n";
}

std::optional<MatchingRates> decodeMatchingRates(const std::string& text, const std::string& key) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("of") || !json["of"].is_string()) return std::nullopt;
  if (!json["of"].get<std::string>().starts_with(key)) return std::nullopt;
  MatchingRates rates;
  const std::pair<const char*, double*> fields[] = {{"seconds_per_photo", &rates.secondsPerPhoto},
                                                    {"seconds_per_pair", &rates.secondsPerPair},
                                                    {"pixels_per_photo", &rates.pixelsPerPhoto},
                                                    {"features_per_photo", &rates.featuresPerPhoto},
                                                    {"inliers_per_pair", &rates.inliersPerPair}};
  for (const auto& [name, value] : fields) {
    if (!json.contains(name) || !json[name].is_number()) return std::nullopt;
    *value = json[name].get<double>();
    if (!(*value >= 0 && *value < 1e9)) return std::nullopt;
  }
  return rates;
}

double relativeSeconds(const MatchingRates& rates) {
  if (rates.pixelsPerPhoto < 1) return 1;
  return std::clamp(rates.secondsPerPhoto / (rates.pixelsPerPhoto * kFeatureSeconds), 0.05, 20.0);
}

namespace {

// The same for the solver, which waits for memory more than features do: the mean of theirs and of matches. On two
// machines that extract features equally fast, matches and mapping took 1.4 times as long on one as on the other.
double relativeSolverSeconds(const MatchingRates& rates) {
  constexpr double kPairSeconds = 5.2e-5;  // of two cores, for each feature of a photo (4.8e-5 to 5.7e-5 were measured)
  const double features = relativeSeconds(rates);
  if (rates.featuresPerPhoto < 1) return features;
  const double pairs = std::clamp(rates.secondsPerPair / (rates.featuresPerPhoto * kPairSeconds), 0.05, 20.0);
  return std::sqrt(features * pairs);
}

}  // namespace

// The constants are fitted to nine runs of 18 to 487 photos on two machines: docs/benchmarks.md, "Photographs without
// poses". Mapping adjusts all photos again and again: its time follows from their number more closely than from that of
// the inliers.
MatchingNeeds planMatching(const MatchingSize& size, const MatchingRates& rates) {
  constexpr double kMapping = 0.314, kMappingGrowth = 1.173, kAdjusting = 0.033, kAdjustingGrowth = 1.316;
  constexpr double kMargin = 1.4;        // of inliers and features, for memory, before they are known
  constexpr double kOfNeighbours = 0.6;  // inliers of all pairs, relative to those of neighbours
  constexpr double kSecondsPerWordFeature = 0.35e-3, kPhotosForWords = 60;
  constexpr double kLookAlikeSeconds = 0.15, kSecondsPerTwoPhotos = 0.0026;  // 50 and 202 photos were measured
  constexpr int64_t kBytesPerFeature = 155, kBytesPerInlier = 16, kModelBytesPerInlier = 31, kModels = 4;
  constexpr int64_t kMapperBytesPerInlier = 560, kMapperBytesPerFeature = 115;
  const double speed = relativeSeconds(rates);
  const auto photos = static_cast<double>(size.photos), pairs = static_cast<double>(size.pairs);
  const auto lookAlikes = static_cast<double>(size.forLookAlikes);
  const double features = size.features > 0 ? static_cast<double>(size.features) : photos * rates.featuresPerPhoto;
  const double inliers =
      size.inliers > 0 ? static_cast<double>(size.inliers) : pairs * rates.inliersPerPair * kOfNeighbours;
  const auto bytes = [](double each, double count) { return static_cast<int64_t>(each * count); };
  MatchingNeeds needs;
  const int extracting = extractionThreads(size.threads, size.pixels, usableMemoryBytes());
  // The few photos that were tried cannot keep more threads busy than they are.
  const double parallel =
      static_cast<double>(extracting) / static_cast<double>(std::min(static_cast<int>(kProbed), extracting));
  needs.features = {photos * rates.secondsPerPhoto / parallel, 32 * kMiB + extractionBytes(extracting, size.pixels),
                    bytes(kBytesPerFeature, features)};
  const double featuresPerPhoto = photos > 0 ? features / photos : 0;
  needs.lookAlikes = {(kSecondsPerWordFeature * std::min(kPhotosForWords, photos) * featuresPerPhoto +
                       kLookAlikeSeconds * photos + kSecondsPerTwoPhotos * photos * lookAlikes) *
                          speed,
                      64 * kMiB + bytes(kBytesPerFeature, features), bytes(0.03 * kBytesPerFeature, features)};
  // The photos that were tried may have had fewer features than most. Time grows about as their number does.
  const double tried = rates.featuresPerPhoto < 1 ? 1 : featuresPerPhoto / rates.featuresPerPhoto;
  needs.matches = {pairs * rates.secondsPerPair * tried, 64 * kMiB + bytes(3000, featuresPerPhoto),
                   bytes(kBytesPerInlier, inliers)};
  const double margin = size.inliers > 0 ? 1 : kMargin;
  const int64_t mapper =
      32 * kMiB + bytes(kMapperBytesPerInlier, margin * inliers) + bytes(kMapperBytesPerFeature, margin * features);
  const double solving = relativeSolverSeconds(rates);
  needs.mapping = {kMapping * std::pow(photos, kMappingGrowth) * solving, mapper,
                   bytes(kModelBytesPerInlier * kModels, inliers)};
  needs.adjusting = {kAdjusting * std::pow(photos, kAdjustingGrowth) * solving, mapper,
                     bytes(kModelBytesPerInlier, inliers)};
  return needs;
}

StageNeeds planFrames(const VideoStream& stream, int count) {
  constexpr double kDecodeSeconds = 7e-9, kLookSeconds = 1.5e-3, kStoreSeconds = 8e-9;  // of a pixel, frame, pixel
  constexpr double kBytesPerPixel = 0.5, kDecoderBytesPerPixel = 40;
  const double pixels = static_cast<double>(stream.width) * stream.height;
  const double frames =
      stream.frames > 0 ? static_cast<double>(stream.frames) : stream.seconds * stream.framesPerSecond;
  if (pixels < 1 || frames < 1) return {};
  const double chosen =
      std::min(frames, count > 0 ? count : std::min(double{kMaxDefaultFrames}, stream.seconds / kShortestInterval));
  return {frames * (2 * pixels * kDecodeSeconds + kLookSeconds) + chosen * pixels * kStoreSeconds,
          64 * kMiB + static_cast<int64_t>(kDecoderBytesPerPixel * pixels),
          static_cast<int64_t>(chosen * pixels * kBytesPerPixel)};
}

namespace {

// Returns the seconds of so many steps on the machine that costs are for. The time of a step grows evenly until it
// settles: 0.16 s in the first 200 steps of `volume` and 0.31 s after 1350 were measured.
double secondsOfSteps(const TrainingCosts& costs, int64_t steps) {
  constexpr double kSettled = 1500;
  const auto count = static_cast<double>(steps), growing = std::min(count, kSettled);
  const double growth = costs.secondsPerLaterStep > 0 ? costs.secondsPerLaterStep - costs.secondsPerStep : 0;
  return count * costs.secondsPerStep + growth * (growing * growing / (2 * kSettled) + count - growing);
}

}  // namespace

TrainingNeeds planTraining(const TrainingSize& size, const TrainingCosts& costs) {
  constexpr double kImportSeconds = 0.04e-6;  // for each pixel of a photo that is made smaller
  constexpr double kImportBytes = 4;          // for each of its pixels
  constexpr double kStartAndEnd = 5;          // seconds, of a program
  constexpr double kBytesPerPixel = 3.3;      // of a photo in memory
  constexpr double kMaxPhotoShare = 0.4;      // of the memory: of more, training holds some at a time
  const auto photos = static_cast<double>(size.photos), heldOut = static_cast<double>(size.heldOut);
  const auto pixels = static_cast<double>(size.photoPixels);
  const double speed = size.relativeSeconds;
  const bool isReduced = size.photoPixels < size.sourcePixels;
  const double shrunk =
      isReduced && size.sourcePixels > 0 ? std::min(1.0, 4 * pixels / static_cast<double>(size.sourcePixels)) : 1;
  TrainingNeeds needs;
  // Each thread holds a photo as it was taken, and the smaller one.
  const double threads = size.threads > 0 ? size.threads : std::max(1u, std::thread::hardware_concurrency());
  const double atOnce = isReduced ? std::min(photos, threads) * static_cast<double>(size.sourcePixels) : 0;
  needs.capture = {
      isReduced ? photos * static_cast<double>(size.sourcePixels) * kImportSeconds * speed : photos * 0.005,
      32 * kMiB + static_cast<int64_t>(kImportBytes * atOnce),
      size.isLinked ? 0 : static_cast<int64_t>(static_cast<double>(size.sourceBytes) * shrunk)};
  const double training =
      size.steps > 0 ? secondsOfSteps(costs, size.steps) * costs.slowness * speed : kSecondsPerMinute * size.minutes;
  needs.train = {
      training * (1 + costs.coarserLevels) + kStartAndEnd,
      costs.trainBytes + static_cast<int64_t>(std::min(kBytesPerPixel * pixels * (photos - heldOut),
                                                       kMaxPhotoShare * static_cast<double>(usableMemoryBytes()))),
      costs.modelBytes};
  // What makes rays slow in training, as fog and leaves do, makes baking slow as well.
  const double bakingSpeed = size.raysPerSecond > 0 ? costs.raysPerSecond / size.raysPerSecond : speed;
  needs.bake = {kStartAndEnd + costs.bakeSeconds * speed +
                    (photos - heldOut) * pixels * 1e-6 * costs.secondsPerBakedMegapixel * bakingSpeed,
                costs.trainBytes / 2, 0};
  if (size.heldOut > 0)
    needs.evaluate = {kStartAndEnd + heldOut * pixels * 1e-6 * costs.secondsPerRenderedMegapixel * speed,
                      costs.trainBytes / 2, 0};
  return needs;
}

TrainingNeeds planGuessedTraining(const TrainingSize& size, const TrainingCosts& costs, const TrainingCosts& certain) {
  TrainingNeeds needs = planTraining(size, costs);
  const TrainingNeeds least = planTraining(size, certain);
  const auto compare = [](StageNeeds& guessed, const StageNeeds& known) {
    guessed.guessedMemoryBytes = guessed.memoryBytes - known.memoryBytes;
    guessed.guessedDiskBytes = guessed.diskBytes - known.diskBytes;
  };
  compare(needs.train, least.train);
  compare(needs.bake, least.bake);
  compare(needs.evaluate, least.evaluate);
  return needs;
}

StageNeeds withoutDone(StageNeeds needs, double share) {
  const double left = std::clamp(1 - share, 0.0, 1.0);
  needs.seconds *= left;
  for (int64_t* bytes : {&needs.diskBytes, &needs.guessedDiskBytes})
    *bytes = static_cast<int64_t>(left * static_cast<double>(*bytes));
  return needs;
}

bool areOnOneDisk(const fs::path& a, const fs::path& b) {
  const auto disk = [](fs::path path) -> std::optional<dev_t> {
    struct stat status {};
    for (path = fs::absolute(path); ::stat(path.c_str(), &status) != 0; path = path.parent_path())
      if (path == path.parent_path()) return std::nullopt;
    return status.st_dev;
  };
  return disk(a) && disk(a) == disk(b);
}

int chooseDownscale(const TrainingSize& size, const TrainingCosts& costs) {
  constexpr double kVisits = 3;
  const double seconds = size.steps > 0 ? secondsOfSteps(costs, size.steps) : kSecondsPerMinute * size.minutes;
  const double pixels = static_cast<double>(size.photos - size.heldOut) * static_cast<double>(size.sourcePixels);
  const int least = (size.longerSide + kLongestSide - 1) / kLongestSide;
  const int most = std::max(least, size.longerSide / kShortestSide);
  const double divisor = std::ceil(std::sqrt(kVisits * pixels / (costs.raysPerSecond * seconds)));
  return static_cast<int>(std::clamp<double>(divisor, std::max(1, least), std::max(1, most)));
}

std::string describePlan(const RunPlan& plan) {
  constexpr double kMiBytes = 1 << 20, kMegabyte = 1e6;
  const auto row = [&](const std::string& name, const StageNeeds& needs) {
    return fmt::format("{:<15} {:>8} {:>8.0f} MiB {:>10.0f} MB\n", name, describeDuration(needs.seconds),
                       static_cast<double>(needs.memoryBytes) / kMiBytes,
                       static_cast<double>(needs.diskBytes) / kMegabyte);
  };
  std::string text = fmt::format("{:<15} {:>8} {:>12} {:>13}\n", "stage", "time", "memory", "disk");
  for (const RunPlan::Entry& entry : plan.entries) text += row(entry.stage, entry.needs);
  return text + row("all", plan.total());
}

void requireRoom(const RunPlan& plan, const fs::path& folder, int64_t freeBytes, int64_t memoryBytes) {
  constexpr double kGigabyte = 1e9, kGiB = 1 << 30;
  constexpr const char* kGuessed = "how large the place is, is known when there are poses";
  const StageNeeds total = plan.total();
  const std::string disk =
      fmt::format("take {:.1f} GB, and {:.1f} GB of its disk are free",
                  static_cast<double>(total.diskBytes) / kGigabyte, static_cast<double>(freeBytes) / kGigabyte);
  if (total.diskBytes - total.guessedDiskBytes > freeBytes)
    throw Error(folder.string(), "", "would " + disk, "name a folder on another disk, or make the photos smaller");
  if (total.diskBytes > freeBytes) warn("{}: may {}; {}", folder.string(), disk, kGuessed);
  for (const RunPlan::Entry& entry : plan.entries) {
    const StageNeeds& needs = entry.needs;
    const std::string memory =
        fmt::format("take {:.1f} GiB of memory of {:.1f} GiB", static_cast<double>(needs.memoryBytes) / kGiB,
                    static_cast<double>(memoryBytes) / kGiB);
    if (needs.memoryBytes - needs.guessedMemoryBytes > memoryBytes) {
      throw Error(
          "stage " + entry.stage, "", "would " + memory,
          "raise --downscale if it is `train`, else use fewer --threads or photos; or use a machine with more memory");
    }
    if (needs.memoryBytes > memoryBytes) warn("stage {}: may {}; {}", entry.stage, memory, kGuessed);
  }
}

void checkRoom(const RunPlan& plan, const fs::path& folder) {
  std::error_code status;
  const auto space = fs::space(folder, status);
  constexpr int64_t kUnknown = std::numeric_limits<int64_t>::max();
  requireRoom(plan, folder, status ? kUnknown : static_cast<int64_t>(space.available), usableMemoryBytes());
}

void announcePlan(const RunPlan& plan, const fs::path& folder, const char* what) {
  constexpr double kGiB = 1 << 30, kGigabyte = 1e9, kLongSeconds = 30;
  const StageNeeds total = plan.total();
  if (total.seconds > kLongSeconds) {
    inform("{} will take about {}, up to {:.1f} GiB of memory and {:.2f} GB of disk", what,
           describeDuration(total.seconds), static_cast<double>(total.memoryBytes) / kGiB,
           static_cast<double>(total.diskBytes) / kGigabyte);
  }
  checkRoom(plan, folder);
}

}  // namespace tessera
