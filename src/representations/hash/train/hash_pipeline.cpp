#include "representations/hash/train/hash_pipeline.h"

#include <algorithm>

#include "compute/composite.h"
#include "compute/encodings.h"
#include "compute/losses.h"
#include "compute/rows.h"

namespace tessera {

HashPipeline::HashPipeline(HashModel& model, const Capacity& capacity)
    : model_(model),
      device_(model.device()),
      capacity_(capacity),
      seen_(device_, capacity.rays, capacity.samples),
      counters_(device_.array<uint32_t>(HashSamples::kCounters)) {
  model.reserve(capacity.rays, capacity.samples, capacity.texels);
  seen_.counters = counters_;
  const size_t rays = capacity.rays, samples = capacity.samples;
  composited_ = device_.array<float>(kColours * rays);
  for (Array<float>* one : {&opacity_, &depth_}) *one = device_.array<float>(rays);
  for (Array<float>* three : {&specular_, &colour_}) *three = device_.array<float>(3 * rays);
  inputs_ = device_.array<float>(kInputs * rays);
  weights_ = device_.array<float>(samples);
  losses_ = device_.array<float>(kLosses);
  if (!capacity.training) return;
  activations_ = device_.allocateActivations(model.config().directionShape(), rays);
  compositedGradients_ = device_.array<float>(kColours * rays);
  inputGradients_ = device_.array<float>(kInputs * rays);
  for (Array<float>* one : {&weightGradients_, &logDensityGradients_}) *one = device_.array<float>(samples);
  colourGradients_ = device_.array<float>(kColours * samples);
}

void HashPipeline::forward(const HashModel::Rays& rays, float minTransmittance) {
  CHECK(rays.count <= capacity_.rays);
  minTransmittance_ = minTransmittance;
  model_.sample(rays, minTransmittance, seen_);
  features_ = model_.evaluateFeatures(seen_, capacity_.training);
  CompositeForward composite;
  composite.minTransmittance = minTransmittance;
  composite.rays = finished(rays);
  composite.firstSample = seen_.firstSample;
  composite.x = Matrix<const float>(features_.data, 1, features_.rowStride);
  composite.steps = seen_.steps;
  composite.distances = seen_.distances;
  composite.colours = features_.columnRange(1, kColours);
  composite.colour = composited_;
  composite.opacity = opacity_;
  composite.depth = depth_;
  composite.weights = weights_;
  device_.run(composite);
  shade(rays);
}

void HashPipeline::shade(const HashModel::Rays& rays) {
  const Count count = finished(rays);
  const Matrix<float> inputs(inputs_, kInputs);
  device_.fillZero(inputs_.all());
  device_.run(AddColumns{count, Matrix<float>(composited_, kColours), inputs.columnRange(0, kColours)});
  device_.run(SphericalHarmonicsForward{4, count, rays.directions, {}, inputs.columnRange(kColours, kHarmonics)});
  device_.run(MlpForward{model_.config().directionShape(), count, inputs, model_.direction().values,
                         Matrix<float>(specular_, 3), capacity_.training ? activations_.all() : Slice<float>()});
  device_.run(ShadeForward{hasLearnedBackground(), count, Matrix<float>(composited_, kColours).columnRange(0, 3),
                           Matrix<float>(specular_, 3), opacity_, colour_});
}

void HashPipeline::backward(const HashModel::Rays& rays, Slice<const float> colourGradients,
                            Slice<float> opacityGradients, Slice<const float> known, const LossScales& scales) {
  const Count count = finished(rays);
  device_.fillZero(losses_.all());
  device_.fillZero(compositedGradients_.all());
  const Matrix<float> composited(compositedGradients_, kColours), sums = composited.columnRange(0, 3);
  device_.run(ShadeBackward{hasLearnedBackground(), count, Matrix<float>(composited_, kColours).columnRange(0, 3),
                            Matrix<float>(specular_, 3), opacity_, colourGradients, sums, opacityGradients});
  const Matrix<float> inputGradients(inputGradients_, kInputs);
  device_.run(MlpBackward{model_.config().directionShape(),
                          count,
                          Matrix<float>(inputs_, kInputs),
                          model_.direction().values,
                          Matrix<float>(specular_, 3),
                          activations_,
                          sums,
                          {},
                          model_.direction().gradients,
                          inputGradients});
  device_.run(AddColumns{count, inputGradients.columnRange(0, kColours), composited});

  DistortionLoss distortion;
  distortion.scale = scales.distortion;
  distortion.normalised = true;
  distortion.rays = count;
  distortion.firstSample = seen_.firstSample;
  distortion.weights = weights_;
  distortion.distances = seen_.middles;
  distortion.steps = seen_.widths;
  distortion.loss = losses_.part(0, 1);
  distortion.weightGradients = weightGradients_;
  device_.run(distortion);
  if (scales.depth > 0) {
    DepthLoss depth;
    depth.scale = scales.depth;
    depth.tolerance = scales.depthTolerance;
    depth.rays = count;
    depth.firstSample = seen_.firstSample;
    depth.weights = weights_;
    depth.distances = seen_.distances;
    depth.known = known;
    depth.loss = losses_.part(1, 1);
    depth.weightGradients = weightGradients_;
    device_.run(depth);
  }
  CompositeBackward back;
  back.minTransmittance = minTransmittance_;
  back.fullGradientDistance = static_cast<float>(model_.config().fullGradientDistance);
  back.rays = count;
  back.firstSample = seen_.firstSample;
  back.x = Matrix<const float>(features_.data, 1, features_.rowStride);
  back.steps = seen_.steps;
  back.distances = seen_.distances;
  back.colours = features_.columnRange(1, kColours);
  back.rayColourGradients = compositedGradients_;
  back.rayOpacityGradients = opacityGradients;
  back.weightGradients = weightGradients_;
  back.xGradients = logDensityGradients_;
  back.colourGradients = Matrix<float>(colourGradients_, kColours);
  device_.run(back);
  model_.fields().backward(seen_.places(), logDensityGradients_, Matrix<float>(colourGradients_, kColours));
}

}  // namespace tessera
