#include "representations/field/train/step_benchmark.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/order_statistics.h"
#include "base/random.h"
#include "compute/composite.h"
#include "compute/losses.h"
#include "compute/roofline.h"
#include "field/radiance_field.h"
#include "representations/field/train/config.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

// A batch of samples as marching produces it, and the memory for one micro-batch of it.
class Step {
 public:
  Step(Device& device, const StepBenchmarkOptions& options)
      : device_(device),
        field_(device, config_.shape(), 1),
        samplesPerRay_(options.samplesPerRay),
        allRays_(options.rays),
        raysPerMicroBatch_(
            std::clamp(static_cast<uint32_t>(config_.samplesPerMicroBatch) / samplesPerRay_, 1u, allRays_)) {
    const size_t rays = raysPerMicroBatch_, samples = size_t{rays} * samplesPerRay_, allRays = allRays_;
    std::vector<uint32_t> first(rays + 1), rayOfSample(samples);
    std::vector<float> directions, targets(allRays * 3), distances(samples);
    const RandomStream random(1, 0x57e9);
    for (size_t r = 0; r <= rays; ++r) first[r] = static_cast<uint32_t>(r) * options.samplesPerRay;
    for (size_t s = 0; s < samples; ++s) {
      rayOfSample[s] = static_cast<uint32_t>(s) / options.samplesPerRay;
      distances[s] = 1 + kStep * static_cast<float>(s % options.samplesPerRay);
    }
    for (size_t r = 0; r < allRays; ++r) {
      const float z = 2 * random.uniform(2 * r) - 1, around = 6.2831853f * random.uniform(2 * r + 1);
      const float xy = std::sqrt(1 - z * z);
      for (const float component : {xy * std::cos(around), xy * std::sin(around), z}) directions.push_back(component);
    }
    for (size_t i = 0; i < targets.size(); ++i) targets[i] = random.uniform((uint64_t{1} << 40) + i);
    field_.reserve(static_cast<uint32_t>(samples));
    allPositions_ = device.uploadArray(rayLikePositions(options.rays, options.samplesPerRay, 1));
    firstSample_ = device.uploadArray(first);
    rayOfSample_ = device.uploadArray(rayOfSample);
    directions_ = device.uploadArray(directions);
    targets_ = device.uploadArray(targets);
    distances_ = device.uploadArray(distances);
    steps_ = device.uploadArray(std::vector<float>(samples, kStep));
    for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(rays);
    for (Array<float>* perRay : {&colour_, &colourGradients_}) *perRay = device.array<float>(rays * 3);
    for (Array<float>* perSample : {&weights_, &logDensityGradients_}) *perSample = device.array<float>(samples);
    sampleColourGradients_ = device.array<float>(samples * 3);
    losses_ = device.array<float>(2);
  }

  uint32_t microBatches() const { return (allRays_ + raysPerMicroBatch_ - 1) / raysPerMicroBatch_; }
  void beginMicroBatch(uint32_t microBatch) {
    firstRay_ = microBatch * raysPerMicroBatch_;
    rays_ = {std::min(raysPerMicroBatch_, allRays_ - firstRay_), {}};
    samples_ = {rays_.capacity * samplesPerRay_, {}};
    positions_ = microBatchPart(allPositions_, samplesPerRay_ * 3);
  }

  void forward() { output_ = field_.forward(samples_, positions_, microBatchPart(directions_, 3), rayOfSample_, true); }

  void composite() {
    CompositeForward composite;
    composite.rays = rays_;
    composite.firstSample = firstSample_;
    composite.x = output_.logDensity;
    composite.steps = steps_;
    composite.distances = distances_;
    composite.colours = output_.colours;
    composite.colour = colour_;
    composite.opacity = opacity_;
    composite.depth = depth_;
    composite.weights = weights_;
    device_.run(composite);

    ColourLoss loss;
    loss.kind = ColourLossKind::huber;
    loss.parameter = static_cast<float>(config_.lossParameter);
    loss.scale = 1.0f / (3.0f * static_cast<float>(allRays_));
    loss.rays = rays_;
    loss.predicted = colour_;
    loss.target = microBatchPart(targets_, 3);
    loss.loss = losses_;
    loss.gradients = colourGradients_;
    device_.run(loss);

    CompositeBackward back;
    back.rays = rays_;
    back.firstSample = firstSample_;
    back.x = output_.logDensity;
    back.steps = steps_;
    back.distances = distances_;
    back.colours = output_.colours;
    back.rayColourGradients = colourGradients_;
    back.xGradients = logDensityGradients_;
    back.colourGradients = Matrix<float>(sampleColourGradients_, 3);
    device_.run(back);
  }

  void backward() {
    field_.backward(samples_, positions_, logDensityGradients_, Matrix<const float>(sampleColourGradients_, 3));
  }

  void adam() {
    Adam settings;
    settings.rate = 1e-4f;  // small, so that the loss and the distribution of gradients hardly change
    settings.skipZeroGradients = true;
    field_.table().step(device_, settings);
    settings.skipZeroGradients = false;
    settings.l2 = static_cast<float>(config_.networkL2);
    field_.densityNetwork().step(device_, settings);
    field_.colourNetwork().step(device_, settings);
  }

  double microBatchLoss() { return device_.read(losses_.all())[0]; }

 private:
  static constexpr float kStep = 0.05f;  // so that a ray with densities near 1 is half transparent at first

  // Returns the part of the whole batch's array that belongs to this micro-batch's rays.
  Slice<const float> microBatchPart(const Array<float>& array, uint32_t perRay) const {
    return array.part(size_t{firstRay_} * perRay, size_t{rays_.capacity} * perRay);
  }

  Device& device_;
  FieldConfig config_;
  RadianceField field_;
  RadianceField::Output output_;
  uint32_t samplesPerRay_, allRays_, raysPerMicroBatch_, firstRay_ = 0;
  Count rays_, samples_;  // of a micro-batch
  Slice<const float> positions_;
  Array<float> allPositions_;
  Array<uint32_t> firstSample_, rayOfSample_;
  Array<float> directions_, targets_, distances_, steps_;
  Array<float> colour_, opacity_, depth_, weights_, losses_;
  Array<float> colourGradients_, logDensityGradients_, sampleColourGradients_;
};

}  // namespace

StepBenchmark benchmarkFieldStep(Device& device, const StepBenchmarkOptions& options) {
  CHECK(options.rays > 0u);
  CHECK(options.samplesPerRay > 0u);
  Step step(device, options);
  struct Part {
    const char* name;
    void (Step::*run)();
    std::vector<double> seconds;
    double now = 0;
  };
  Part parts[] = {{"forward", &Step::forward, {}},
                  {"composite", &Step::composite, {}},
                  {"backward", &Step::backward, {}},
                  {"adam", &Step::adam, {}}};  // adam runs once per step, the others in every micro-batch
  StepBenchmark result;
  result.samples = options.rays * options.samplesPerRay;
  std::vector<double> whole;
  double spent = 0;
  for (int i = 0; i < 5 || spent < options.seconds; ++i) {
    const bool counts = i >= 2;
    double total = 0, loss = 0;
    const auto time = [&](Part& part) {
      const auto start = Clock::now();
      (step.*part.run)();
      device.finish();
      part.now += std::chrono::duration<double>(Clock::now() - start).count();
    };
    for (uint32_t microBatch = 0; microBatch < step.microBatches(); ++microBatch) {
      step.beginMicroBatch(microBatch);
      for (Part* part = parts; part != parts + 3; ++part) time(*part);
      loss += step.microBatchLoss();
    }
    time(parts[3]);
    for (Part& part : parts) {
      if (counts) part.seconds.push_back(part.now);
      total += part.now;
      part.now = 0;
    }
    if (counts) {
      whole.push_back(total);
      spent += total;
    }
    result.lastLoss = loss;
    if (i == 0) result.firstLoss = result.lastLoss;
  }
  result.steps = static_cast<int>(whole.size());
  result.medianSeconds = upperMedian(whole);
  result.bestSeconds = *std::min_element(whole.begin(), whole.end());
  result.samplesPerSecond = result.samples / result.medianSeconds;
  for (Part& part : parts) result.phases.push_back({part.name, upperMedian(part.seconds)});
  return result;
}

}  // namespace tessera
