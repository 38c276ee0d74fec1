#include "pipeline/training_planner.h"

#include <algorithm>
#include <cmath>
#include <exception>

#include "base/folder_size.h"
#include "base/order_statistics.h"
#include "import/capture_reader.h"
#include "pipeline/training_progress.h"

namespace tessera {
namespace {

int64_t typicalPixels(const Capture& capture) {
  std::vector<int64_t> pixels;
  for (const Photo& photo : capture.photos) {
    const Camera& camera = capture.cameras[static_cast<size_t>(photo.camera)];
    pixels.push_back(int64_t{camera.width} * camera.height);
  }
  return pixels.empty() ? 0 : upperMedian(pixels);
}

}  // namespace

TrainingPlanner::TrainingPlanner(const PhotoRunOptions& options, Source source)
    : options_(options), source_(std::move(source)) {}

TrainingNeeds TrainingPlanner::needs() {
  costs();
  TrainingSize size = source_.size();
  if (isCaptureKept_ && capturePixels_ > 0) size.photoPixels = capturePixels_;
  if (isModelKept_) size.raysPerSecond = readRaysPerSecond(options_.out / "model");
  return isCaptureKept_ || !source_.isGuess ? planTraining(size, costs())
                                            : planGuessedTraining(size, costs(), options_.costs);
}

StageNeeds TrainingPlanner::captureNeeds(bool resumes) {
  isCaptureKept_ = false;
  StageNeeds capture = needs().capture;
  if (resumes) capture.diskBytes = std::max(int64_t{0}, capture.diskBytes - bytesBelow(options_.out / "capture"));
  return capture;
}

StageNeeds TrainingPlanner::trainNeeds(bool resumes) {
  const double finest = 1 / (1 + costs().coarserLevels);  // the share of the finest level, which is trained first
  return withoutDone(needs().train, resumes ? finest * shareTrained() : 0);
}

void TrainingPlanner::captureIsWritten() {
  isCaptureKept_ = true;
  costs_.reset();
}

std::optional<Capture> TrainingPlanner::keptCapture() const {
  const fs::path folder = options_.out / "capture";
  std::error_code status;
  if (!isCaptureKept_ || !fs::exists(folder / "transforms.json", status)) return std::nullopt;
  return readCapture(folder);
}

std::optional<Capture> TrainingPlanner::expectedCapture() const {
  std::optional<Capture> capture = source_.capture();
  if (!capture) return capture;
  // Heights by tags are not precise: rather more blocks than fewer.
  constexpr double kFiner = 1.1;
  const double factor = (source_.isGuess ? kFiner : 1) / source_.downscale();
  const auto side = [factor](int pixels) { return std::max(1, static_cast<int>(std::lround(factor * pixels))); };
  for (Camera& camera : capture->cameras) camera = camera.scaledTo(side(camera.width), side(camera.height));
  return capture;
}

const TrainingCosts& TrainingPlanner::costs() {
  if (costs_) return *costs_;
  costs_ = options_.costs;
  capturePixels_ = 0;
  try {
    std::optional<Capture> capture = keptCapture();
    if (capture) capturePixels_ = typicalPixels(*capture);
    if (!options_.costsOnCapture) return *costs_;
    if (!capture) capture = expectedCapture();
    if (capture) costs_ = options_.costsOnCapture(*capture);
  } catch (const std::exception&) {  // a damaged capture, of which training says so; the plan is only advice
  }
  return *costs_;
}

double TrainingPlanner::shareTrained() const {
  const TrainingProgress done = readTrainingProgress(options_.out / "model");
  if (done.plannedSteps > 0) return static_cast<double>(done.step) / static_cast<double>(done.plannedSteps);
  return options_.steps > 0 ? 0 : done.seconds / (60 * options_.minutes);
}

}  // namespace tessera
