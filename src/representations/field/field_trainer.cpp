#include "representations/field/field_trainer.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/log.h"
#include "base/random.h"
#include "train/schedule.h"
#include "train/visible_cells.h"

namespace tessera {
namespace {

constexpr uint32_t kRoomPerWanted = 2;  // for passes that see more than the last step's did
constexpr uint32_t kRoomPerRay = 8;     // so that the first round of marching fits
constexpr uint32_t kLosses = 4;         // of a pass: colour loss, squared error, distortion, depth
constexpr float kMinTransmittance = 1e-4f;
constexpr double kMostPixelsOff = 2;  // an observation farther from its point's image teaches nothing

ColourLossKind lossKind(const std::string& name) {
  if (name == "mse") return ColourLossKind::mse;
  if (name == "huber") return ColourLossKind::huber;
  if (name == "charbonnier") return ColourLossKind::charbonnier;
  throw Error("--set loss=" + name, "", "there is no such colour loss", "use huber, mse or charbonnier");
}

std::vector<RayCamera> rayCameras(const Capture& capture, const SceneFrame& frame) {
  std::vector<RayCamera> cameras;
  for (const Photo& photo : capture.photos) {
    cameras.push_back(makeRayCamera(capture.cameras[photo.camera], photo.worldFromCamera, frame));
  }
  return cameras;
}

std::vector<int> trainingPhotos(const Capture& capture) {
  std::vector<int> photos = capture.photosIn(Split::train);
  if (photos.empty()) {
    throw Error(capture.root.string(), "transforms.json", "no photo is marked for training",
                "import again with another --holdout");
  }
  return photos;
}

}  // namespace

FieldTrainer::FieldTrainer(Device& device, const Capture& capture, const FieldConfig& config, const SceneFrame& frame)
    : device_(device),
      capture_(capture),
      config_(config),
      model_(device, config, frame),
      photos_(capture, trainingPhotos(capture),
              {static_cast<size_t>(config.photoBudgetMiB * 1048576), config.stepsPerPhoto,
               static_cast<uint64_t>(config.seed)}),
      known_(knownDistances(capture, frame, kMostPixelsOff)),
      rays_(static_cast<uint32_t>(config.firstRays)),
      cameras_(device.arrayOf(rayCameras(capture, frame))),
      exposures_(device, "exposures", std::vector<float>(capture.photos.size() * 3)) {
  lossKind(config.loss);
  const std::vector<bool> visible = visibleCells(capture, frame, model_.space());
  if (std::find(visible.begin(), visible.end(), true) == visible.end()) {
    throw Error(capture.root.string(), "transforms.json", "no training photo sees any of the scene",
                "look whether the poses are right, and the lens and its distortion");
  }
  model_.occupancy().exclude(visible);
  const uint32_t rays = static_cast<uint32_t>(config.mostRays);
  const uint32_t perPass = static_cast<uint32_t>(std::min(config.samplesPerStep, config.samplesPerPass));
  passes_ = (static_cast<uint32_t>(config.samplesPerStep) + perPass - 1) / perPass;
  const uint32_t raysPerPass = (rays + passes_ - 1) / passes_;
  const uint32_t samples =
      std::max({kRoomPerWanted * perPass, std::min(kRoomPerRay * raysPerPass, 4 * perPass), FieldConfig::kMostSteps});
  seen_ = RaySamples(device, raysPerPass, samples);
  counters_ = device.array<uint32_t>(size_t{passes_} * RaySamples::kCounters);
  photoOfRay_ = device.array<uint32_t>(rays);
  for (Array<float>* perRay : {&weights_, &jitter_, &distances_, &opacity_, &depth_, &opacityGradients_}) {
    *perRay = device.array<float>(rays);
  }
  pixels_ = device.array<float>(size_t{rays} * 2);
  for (Array<float>* perRay :
       {&targets_, &backgrounds_, &origins_, &directions_, &colour_, &exposed_, &colourGradients_}) {
    *perRay = device.array<float>(size_t{rays} * 3);
  }
  losses_ = device.array<float>(size_t{passes_} * kLosses);
  for (Array<float>* perSample : {&sampleWeights_, &weightGradients_, &logDensityGradients_}) {
    *perSample = device.array<float>(samples);
  }
  sampleColourGradients_ = device.array<float>(size_t{samples} * 3);
}

void FieldTrainer::refreshOccupancy(int64_t step) {
  if (step % config_.occupancyEvery != 0) return;
  const uint32_t cells = model_.occupancy().visibleCells();
  const uint64_t seed = mix64(static_cast<uint64_t>(config_.seed) ^ (static_cast<uint64_t>(step) << 20));
  if (step < config_.occupancyWarmUp) {
    model_.refreshOccupancy(cells, 0, seed);
  } else {
    const uint32_t share = static_cast<uint32_t>(std::ceil(cells * config_.occupancyShare));
    model_.refreshOccupancy(share, share, seed);
  }
}

void FieldTrainer::uploadRays() {
  device_.write(photoOfRay_.all(), std::span<const uint32_t>(batch_.photoOfRay));
  device_.write(pixels_.all(), std::span<const float>(batch_.pixels));
  device_.write(targets_.all(), std::span<const float>(batch_.targets));
  device_.write(backgrounds_.all(), std::span<const float>(batch_.backgrounds));
  device_.write(weights_.all(), std::span<const float>(batch_.weights));
  device_.write(jitter_.all(), std::span<const float>(batch_.jitter));
  device_.write(distances_.all(), std::span<const float>(batch_.distances));
  device_.run(GenerateRays{{rays_, {}}, cameras_, photoOfRay_, pixels_, origins_, directions_});
}

StepReport FieldTrainer::step(int64_t step, int64_t plannedSteps) {
  refreshOccupancy(step);
  const double knownShare = config_.depth > 0 ? config_.knownShare : 0;
  drawRays(photos_.at(step), known_, {static_cast<uint64_t>(config_.seed), config_.randomBackground, knownShare}, step,
           rays_, batch_);
  uploadRays();
  const auto raysBefore = [&](uint32_t pass) { return static_cast<uint32_t>(uint64_t{rays_} * pass / passes_); };
  for (uint32_t pass = 0; pass < passes_; ++pass) {
    addGradients(pass, raysBefore(pass), raysBefore(pass + 1) - raysBefore(pass));
  }
  updateParameters(step, plannedSteps);

  // The step is over: its counters may be read.
  const std::vector<uint32_t> counters = device_.read(counters_.all());
  const std::vector<float> losses = device_.read(losses_.all());
  StepReport report;
  double squares = 0, weight = 0;
  for (uint32_t pass = 0; pass < passes_; ++pass) {
    const uint32_t* counter = &counters[size_t{pass} * RaySamples::kCounters];
    report.samples += counter[0];
    report.rays += counter[1];
    for (uint32_t round = 0; round < RaySamples::kRounds; ++round) report.marched += counter[2 + round];
    const float* loss = &losses[size_t{pass} * kLosses];
    report.loss += loss[0] + loss[2] + loss[3];
    squares += loss[1];
    for (uint32_t ray = 0; ray < counter[1]; ++ray) weight += batch_.weights[raysBefore(pass) + ray];
  }
  report.squaredError = squares / std::max(1.0, 3 * weight);

  const double perRay = std::max(1.0, static_cast<double>(report.samples)) / std::max(1u, report.rays);
  double wanted = config_.samplesPerStep / perRay;
  if (report.rays < rays_) wanted = std::min<double>(wanted, report.rays);  // not all of them fitted
  const double rounded = std::ceil(wanted / 8) * 8;
  rays_ = static_cast<uint32_t>(std::clamp<double>(rounded, 8, config_.mostRays));
  return report;
}

void FieldTrainer::addGradients(uint32_t pass, uint32_t firstRay, uint32_t rayCount) {
  const auto ofRays = [&](auto& array, uint32_t columns) {
    return array.part(size_t{firstRay} * columns, size_t{rayCount} * columns);
  };
  const Slice<const float> directions = ofRays(directions_, 3);
  const Slice<const uint32_t> photoOfRay = ofRays(photoOfRay_, 1);
  const Slice<float> losses = losses_.part(size_t{pass} * kLosses, kLosses);
  seen_.counters = counters_.part(size_t{pass} * RaySamples::kCounters, RaySamples::kCounters);
  model_.sample({rayCount, ofRays(origins_, 3), directions, ofRays(jitter_, 1), {}}, kMinTransmittance, seen_);
  const Count samples = seen_.samples(), rays = seen_.finished(rayCount);
  RadianceField& field = model_.field();
  const RadianceField::Output output = field.forward(samples, seen_.positions, directions, seen_.rayOfSample, true);

  CompositeForward composite;
  composite.minTransmittance = kMinTransmittance;
  composite.rays = rays;
  composite.firstSample = seen_.firstSample;
  composite.x = output.logDensity;
  composite.steps = seen_.steps;
  composite.distances = seen_.distances;
  composite.colours = output.colours;
  composite.colour = ofRays(colour_, 3);
  composite.opacity = ofRays(opacity_, 1);
  composite.depth = ofRays(depth_, 1);
  composite.weights = sampleWeights_;
  device_.run(composite);
  device_.run(ExposureForward{rays, composite.colour, composite.opacity, ofRays(backgrounds_, 3), photoOfRay,
                              exposures_.values, ofRays(exposed_, 3)});

  ColourLoss loss;
  loss.kind = lossKind(config_.loss);
  loss.parameter = static_cast<float>(config_.lossParameter);
  loss.scale = 1.0f / (3.0f * static_cast<float>(rays_));
  loss.rays = rays;
  loss.predicted = ofRays(exposed_, 3);
  loss.target = ofRays(targets_, 3);
  loss.weights = ofRays(weights_, 1);
  loss.loss = losses.part(0, 2);
  loss.gradients = ofRays(colourGradients_, 3);
  device_.run(loss);
  device_.run(ExposureBackward{rays, composite.colour, ofRays(backgrounds_, 3), photoOfRay, exposures_.values,
                               loss.gradients, loss.gradients, ofRays(opacityGradients_, 1), exposures_.gradients});
  DistortionLoss distortion;
  distortion.scale = static_cast<float>(config_.distortion) / static_cast<float>(rays_);
  distortion.rays = rays;
  distortion.firstSample = seen_.firstSample;
  distortion.weights = sampleWeights_;
  distortion.distances = seen_.distances;
  distortion.steps = seen_.steps;
  distortion.loss = losses.part(2, 1);
  distortion.weightGradients = weightGradients_;
  device_.run(distortion);
  if (config_.depth > 0 && config_.knownShare > 0) {
    DepthLoss depth;
    depth.scale = static_cast<float>(config_.depth) / static_cast<float>(rays_);
    depth.tolerance = static_cast<float>(config_.depthTolerance);
    depth.rays = rays;
    depth.firstSample = seen_.firstSample;
    depth.weights = sampleWeights_;
    depth.distances = seen_.distances;
    depth.known = ofRays(distances_, 1);
    depth.loss = losses.part(3, 1);
    depth.weightGradients = weightGradients_;
    device_.run(depth);
  }

  CompositeBackward back;
  back.minTransmittance = kMinTransmittance;
  back.fullGradientDistance = static_cast<float>(config_.fullGradientDistance);
  back.rays = rays;
  back.firstSample = seen_.firstSample;
  back.x = output.logDensity;
  back.steps = seen_.steps;
  back.distances = seen_.distances;
  back.colours = output.colours;
  back.rayColourGradients = loss.gradients;
  back.rayOpacityGradients = ofRays(opacityGradients_, 1);
  back.weightGradients = weightGradients_;
  back.xGradients = logDensityGradients_;
  back.colourGradients = Matrix<float>(sampleColourGradients_, 3);
  device_.run(back);
  field.backward(samples, seen_.positions, logDensityGradients_, Matrix<const float>(sampleColourGradients_, 3));
}

void FieldTrainer::updateParameters(int64_t step, int64_t plannedSteps) {
  RateSchedule schedule;
  schedule.rate = config_.rate;
  schedule.finalFactor = config_.finalRateFactor;
  schedule.constantFraction = config_.constantRateShare;
  Adam adam;
  adam.rate = static_cast<float>(schedule.at(step, plannedSteps));
  adam.skipZeroGradients = true;
  adam.l2 = static_cast<float>(config_.tableL2);
  model_.field().table().step(device_, adam);
  adam.skipZeroGradients = false;
  adam.l2 = static_cast<float>(config_.networkL2);
  model_.field().densityNetwork().step(device_, adam);
  model_.field().colourNetwork().step(device_, adam);
  if (!config_.exposure) {
    device_.fillZero(exposures_.gradients.all());
    return;
  }
  Adam exposure;
  exposure.rate = static_cast<float>(config_.exposureRate * adam.rate / config_.rate);
  exposure.skipZeroGradients = true;
  exposures_.step(device_, exposure);
  if (step % 16 == 15) centreExposures();
}

// Only differences between photos can be told: the mean gain of each channel stays zero, which is what evaluation uses.
void FieldTrainer::centreExposures() {
  std::vector<float> gains = device_.read(exposures_.values.all());
  const std::vector<int> photos = capture_.photosIn(Split::train);
  for (int channel = 0; channel < 3; ++channel) {
    double mean = 0;
    for (const int photo : photos) mean += gains[3 * photo + channel];
    mean /= static_cast<double>(photos.size());
    for (const int photo : photos) gains[3 * photo + channel] -= static_cast<float>(mean);
  }
  device_.write(exposures_.values.all(), std::span<const float>(gains));
}

Bytes FieldTrainer::save() {
  TensorSet tensors;
  model_.save(tensors, true);
  tensors.add(device_, exposures_, true);
  tensors.add("rays", std::vector<uint32_t>{rays_});
  return tensors.encode({{"format", "tessera field 1"}, {"device", device_.target()}});
}

void FieldTrainer::restore(const fs::path& path, const Safetensors& state) {
  const auto format = state.metadata.find("format");
  if (format == state.metadata.end() || format->second != "tessera field 1") {
    throw Error(path.string(), "", "is not a checkpoint of --method field", "train again");
  }
  const auto device = state.metadata.find("device");
  if (device != state.metadata.end() && device->second != device_.target()) {
    warn("{} was trained on {}; going on with {} gives as good a model, but not the same bits", path.string(),
         device->second, device_.target());
  }
  model_.restore(path, state);
  loadGroup(device_, path, state, exposures_);
  const TensorView& rays = state.require(path, "rays", TensorType::u32);
  if (rays.elements() != 1) throw Error(path.string(), "tensor rays", "is not one number", "train again");
  rays_ = std::clamp(rays.as<uint32_t>()[0], 1u, static_cast<uint32_t>(config_.mostRays));
}

}  // namespace tessera
