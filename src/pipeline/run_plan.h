// What a run from photos will take: seconds, memory and disk of its stages, from the size of the task and from how fast
// this machine extracts and matches features of a few of the photos.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/file.h"
#include "photogrammetry/photo_list.h"
#include "photogrammetry/video_list.h"
#include "pipeline/stage.h"

namespace tessera {

// What features and matches take on this machine: of a few photos, measured. The defaults are those of two cores and
// photos of 800×600.
struct MatchingRates {
  double secondsPerPhoto = 0.8;    // features
  double secondsPerPair = 0.3;     // matches
  double pixelsPerPhoto = 480000;  // of the photos that were tried
  double featuresPerPhoto = 4000;  // mean
  double inliersPerPair = 400;     // mean of neighbours
};

// Returns the rates that photos of this size have on two cores.
MatchingRates expectRates(const PhotoList& list);

// Measures them with COLMAP on five successive photos from the middle of the list, in `folder`, which is removed
// afterwards. `look` is called now and then; what it throws ends the program that runs. Throws Error if COLMAP cannot
// be run. Returns expectRates() if there are fewer than 15 photos, of which a probe would be a large part of the task,
// or, with a warning, if COLMAP fails on these photos.
MatchingRates measureMatchingRates(const PhotoList& list, int threads, const fs::path& folder,
                                   const std::function<void()>& look);

// Rates as JSON, with `key`, which tells what they were measured on. Reading returns nothing if the key does not begin
// with this one, or of a damaged text.
std::string encodeMatchingRates(const MatchingRates& rates, const std::string& key);
std::optional<MatchingRates> decodeMatchingRates(const std::string& text, const std::string& key);

// How large the task is, as far as it is known.
struct MatchingSize {
  int64_t photos = 0;
  int64_t pixels = 0;         // of the largest photo, in which features are looked for
  int64_t pairs = 0;          // that are compared
  int64_t features = 0;       // of all photos; 0: not known yet
  int64_t inliers = 0;        // of all pairs; 0: not known yet
  int threads = 0;            // of the machine that are used
  int64_t forLookAlikes = 0;  // photos of which others are searched for that look like them
};

// What the stages of structure from motion take, from their beginning to their end.
struct MatchingNeeds {
  StageNeeds features, lookAlikes, matches, mapping, adjusting;
};
MatchingNeeds planMatching(const MatchingSize& size, const MatchingRates& rates);

// What photos from a video take: the stage that decodes it twice, and stores `count` frames (0: as many as chooseFrames
// takes then). Zeros if the file does not state enough.
StageNeeds planFrames(const VideoStream& stream, int count);

// What a representation costs to train, bake and evaluate on two cores with AVX-512, by order of magnitude: measured on
// small scenes, and for the blocks into which training divides a capture.
struct TrainingCosts {
  double secondsPerStep = 0.2;     // at the beginning, and
  double secondsPerLaterStep = 0;  // above 0: after 1500 steps
  double slowness = 1;             // how many times as long steps take on this machine's vector unit
  double raysPerSecond = 20000;
  double bakeSeconds = 20;                 // whatever the photos, and
  double secondsPerBakedMegapixel = 1;     // of the training photos, if training has as many rays a second as above
  double secondsPerRenderedMegapixel = 1;  // of the photos held out
  int64_t trainBytes = 0;                  // of memory, besides the photos
  int64_t modelBytes = 0;                  // on disk, the scene included
  double coarserLevels = 0;                // time for coarser levels of detail after the finest, as a share of its time
};

// How large the capture is that a model is trained on.
struct TrainingSize {
  int64_t photos = 0, heldOut = 0;
  int64_t photoPixels = 0;     // of one photo of the capture
  int64_t sourcePixels = 0;    // of one photo as it was taken, whose
  int longerSide = 0;          // has so many
  int64_t sourceBytes = 0;     // on disk, of all photos
  double minutes = 0;          // of training; or
  int64_t steps = 0;           // steps, if above 0
  double relativeSeconds = 1;  // that this machine takes for what takes two cores one
  double raysPerSecond = 0;    // that training has had on this capture; 0: not known yet
  int threads = 0;             // of the import; 0: all
  bool isLinked = false;       // whether the capture links the photos instead of copying them
};

struct TrainingNeeds {
  StageNeeds capture, train, bake, evaluate;
};
TrainingNeeds planTraining(const TrainingSize& size, const TrainingCosts& costs);
// The same by the costs of a place whose size is guessed. `certain`: the costs at least.
TrainingNeeds planGuessedTraining(const TrainingSize& size, const TrainingCosts& costs, const TrainingCosts& certain);

inline constexpr int kLongestSide = 1600, kShortestSide = 400;  // pixels of the longer side of a photo

// Returns by what width and height of photos are divided so that training, with the usual number of rays a second,
// passes kVisits times through each pixel: at least until the longer side has at most kLongestSide pixels, and at most
// until it has kShortestSide. A GPU trains more rays, and gets larger photos.
int chooseDownscale(const TrainingSize& size, const TrainingCosts& costs);

// Returns a plan as a table, a line for each stage and one for all.
std::string describePlan(const RunPlan& plan);

// Throws Error, with a remedy, if a plan takes more disk than is free where `folder` is, or a stage more memory than
// there is. Of what is guessed, it only warns.
void requireRoom(const RunPlan& plan, const fs::path& folder, int64_t freeBytes, int64_t memoryBytes);

// requireRoom with the disk and the memory of this machine.
void checkRoom(const RunPlan& plan, const fs::path& folder);

// States what a plan takes, if that is long, and checks it. `what`: for people, what is planned.
void announcePlan(const RunPlan& plan, const fs::path& folder, const char* what = "this");

// Returns what is left of a stage of which this share, from 0 to 1, is done.
StageNeeds withoutDone(StageNeeds needs, double share);

// Whether files on one of these paths, which need not exist yet, can be links to files on the other.
bool areOnOneDisk(const fs::path& a, const fs::path& b);

// How many seconds this machine takes for what two cores do in one, by its rates.
double relativeSeconds(const MatchingRates& rates);

}  // namespace tessera
