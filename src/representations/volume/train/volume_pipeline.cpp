#include "representations/volume/train/volume_pipeline.h"

#include <algorithm>

#include "compute/blend.h"
#include "compute/composite.h"
#include "compute/losses.h"
#include "compute/proposals.h"
#include "compute/rows.h"

namespace tessera {
namespace {

constexpr uint32_t kAttributes = VirtualGrid::kAttributes, kColours = kAttributes - 1;

}  // namespace

VolumePipeline::VolumePipeline(VolumeModel& model, const Capacity& capacity)
    : model_(model), device_(model.device()), capacity_(capacity) {
  const VolumeConfig& config = model.config();
  const BlockSpace& space = model.space();
  const size_t rays = capacity.rays, slots = model.slots();
  const uint32_t intervals[kRounds] = {static_cast<uint32_t>(config.firstIntervals),
                                       static_cast<uint32_t>(config.secondIntervals)};
  range_ = device_.array<float>(2 * rays);
  for (uint32_t r = 0; r < rounds(); ++r) {
    Round& round = round_[r];
    round.intervals = intervals[r];
    const size_t rows = rays * intervals[r];
    round.fences = device_.array<float>(rays * (intervals[r] + 1));
    round.firstSample = device_.array<uint32_t>(rays + 1);
    round.rowCount = device_.array<uint32_t>(1);
    round.firstOfSlot = device_.array<uint32_t>(slots + 1);
    for (Array<uint32_t>* words : {&round.blockOfSample, &round.source}) *words = device_.array<uint32_t>(rows);
    for (Array<float>* three : {&round.positions, &round.groupedPositions}) *three = device_.array<float>(3 * rows);
    for (Array<float>* one : {&round.distances, &round.steps, &round.logDensities, &round.weights}) {
      *one = device_.array<float>(rows);
    }
    round.opacity = device_.array<float>(rays);
    if (capacity.training) {
      for (Array<float>* one : {&round.weightGradients, &round.gradients}) *one = device_.array<float>(rows);
    }
    round.batch = BlockFieldBatch(device_, model.proposals().shape(), static_cast<uint32_t>(rows), capacity.training);
    round.batch.firstOfSlot = round.firstOfSlot;
    round.batch.positions = round.groupedPositions;
  }
  fences_ = device_.array<float>(rays * (samples() + size_t{1}));

  BlockSamples maximum{space};
  maximum.intervals = samples();
  maximum.split = true;
  rowCapacity_ = capacity.points + maximum.maxSamples(capacity.rays);
  segmentCapacity_ = maximum.maxSegments(capacity.rays);
  const size_t rows = rowCapacity_, segments = segmentCapacity_;
  firstSample_ = device_.array<uint32_t>(rays + 1);
  rowCount_ = device_.array<uint32_t>(1);
  blockOfSample_ = device_.array<uint32_t>(rows);
  positions_ = device_.array<float>(3 * rows);
  for (Array<float>* one :
       {&distances_, &steps_, &middles_, &widths_, &runtimeSteps_, &logDensities_, &weights_, &segmentWeights_}) {
    *one = device_.array<float>(rows);
  }
  colours_ = device_.array<float>(kColours * rows);
  firstSegment_ = device_.array<uint32_t>(rays + 1);
  segmentCount_ = device_.array<uint32_t>(1);
  firstSampleOfSegment_ = device_.array<uint32_t>(segments + 1);
  for (Array<uint32_t>* words : {&groupOfSegment_, &rayOfSegment_}) *words = device_.array<uint32_t>(segments);
  if (model.virtualGrid().shareTexels) {
    for (Array<uint32_t>* words : {&marks_, &ranks_}) {
      *words = device_.array<uint32_t>(slots * std::max(model.virtualGrid().words(), capacity.maxWords));
    }
  }
  firstTexel_ = device_.array<uint32_t>(slots + 1);
  texelPositions_ = device_.array<float>(size_t{3} * capacity.texels);
  texels_ = BlockFieldBatch(device_, model.attributes().shape(), capacity.texels, capacity.training);
  texels_.firstOfSlot = firstTexel_;
  texels_.positions = texelPositions_;
  composited_ = device_.array<float>(kColours * segments);
  for (Array<float>* one : {&segmentOpacity_, &segmentDepth_}) *one = device_.array<float>(segments);
  specular_ = device_.array<float>(3 * segments);
  colour_ = device_.array<float>(3 * rays);
  for (Array<float>* one : {&opacity_, &depth_, &rayOpacity_}) *one = device_.array<float>(rays);
  losses_ = device_.array<float>(kLosses);
  if (!capacity.training) return;
  for (Array<float>* one : {&logDensityGradients_, &weightGradients_}) *one = device_.array<float>(rows);
  colourGradients_ = device_.array<float>(kColours * rows);
  compositedGradients_ = device_.array<float>(kColours * segments);
  segmentOpacityGradients_ = device_.array<float>(segments);
  specularGradients_ = device_.array<float>(3 * segments);
}

Slice<const float> VolumePipeline::roundJitter(const VolumeRays& rays, uint32_t round) const {
  return rays.jitter ? rays.jitter.part(size_t{round} * rays.count, rays.count) : Slice<const float>();
}

void VolumePipeline::forward(const VolumeRays& rays, const Options& options) {
  CHECK(rays.count <= capacity_.rays);
  keptProposals_ = options.keepProposals;
  keptAttributes_ = options.keepAttributes;
  device_.run(EnterScene{model_.space(),
                         {rays.count},
                         round_[0].intervals,
                         rays.origins,
                         rays.directions,
                         roundJitter(rays, 0),
                         rays.near,
                         range_,
                         round_[0].fences});
  for (uint32_t round = 0; round < rounds(); ++round) propose(rays, round, options);
  if (capacity_.points > 0) {
    device_.run(BlockPoints{model_.space(), capacity_.points, options.seed, model_.virtualGrid().planes,
                            model_.residentBlockNumbers(), model_.slotOfBlock(), blockOfSample_, positions_,
                            runtimeSteps_});
  }
  locateSamples(rays);
  evaluateTexels(options);
  composite(rays);
}

void VolumePipeline::propose(const VolumeRays& rays, uint32_t r, const Options& options) {
  Round& round = round_[r];
  BlockSamples locate{model_.space()};
  locate.rays = {rays.count};
  locate.intervals = round.intervals;
  locate.origins = rays.origins;
  locate.directions = rays.directions;
  locate.range = range_;
  locate.farOfRay = rays.far;
  locate.fences = round.fences;
  locate.slotOfBlock = model_.slotOfBlock();
  locate.firstSample = round.firstSample;
  locate.rowCount = round.rowCount;
  locate.blockOfSample = round.blockOfSample;
  locate.positions = round.positions;
  locate.distances = round.distances;
  locate.steps = round.steps;
  device_.run(locate);
  const Count rows{rays.count * round.intervals};
  device_.run(GroupByBlock{rows, model_.slots(), round.blockOfSample, round.firstOfSlot, round.source});
  device_.run(
      GatherRows{rows, round.source, Matrix<float>(round.positions, 3), Matrix<float>(round.groupedPositions, 3)});
  model_.proposals().forward(round.batch, options.keepProposals);
  device_.run(
      ScatterRows{rows, round.source, Matrix<float>(round.batch.outputs, 1), Matrix<float>(round.logDensities, 1)});
  CompositeForward weights;
  weights.minTransmittance = 0;
  weights.rays = {rays.count};
  weights.firstSample = round.firstSample;
  weights.x = Matrix<float>(round.logDensities, 1);
  weights.steps = round.steps;
  weights.opacity = round.opacity;
  weights.weights = round.weights;
  device_.run(weights);
  ResampleFences resample;
  resample.rays = {rays.count};
  resample.before = round.intervals;
  const bool last = r + 1 == rounds();
  resample.after = last ? samples() : round_[r + 1].intervals;
  resample.anneal = options.anneal;
  resample.uniformFraction = std::max(static_cast<float>(model_.config().uniformSampleFraction), options.uniformFraction);
  resample.fences = round.fences;
  resample.weights = round.weights;
  resample.jitter = roundJitter(rays, r + 1);
  resample.resampled = last ? fences_.all() : round_[r + 1].fences.all();
  device_.run(resample);
}

void VolumePipeline::locateSamples(const VolumeRays& rays) {
  BlockSamples locate{model_.space()};
  locate.rays = {rays.count};
  locate.intervals = samples();
  locate.split = true;
  locate.firstRow = capacity_.points;
  locate.origins = rays.origins;
  locate.directions = rays.directions;
  locate.range = range_;
  locate.farOfRay = rays.far;
  locate.fences = fences_;
  locate.firstSample = firstSample_;
  locate.rowCount = rowCount_;
  locate.blockOfSample = blockOfSample_;
  locate.positions = positions_;
  locate.distances = distances_;
  locate.steps = steps_;
  locate.middles = middles_;
  locate.widths = widths_;
  locate.runtimeSteps = runtimeSteps_;
  locate.texels = model_.virtualGrid().planes;
  locate.slotOfBlock = model_.slotOfBlock();
  locate.groupOfBlock = model_.groupOfSlot();
  locate.firstSegment = firstSegment_;
  locate.segmentCount = segmentCount_;
  locate.firstSampleOfSegment = firstSampleOfSegment_;
  locate.groupOfSegment = groupOfSegment_;
  locate.rayOfSegment = rayOfSegment_;
  device_.run(locate);
}

void VolumePipeline::evaluateTexels(const Options& options) {
  const uint32_t slots = model_.slots();
  DistinctTexels distinct{model_.virtualGrid()};
  distinct.blocks = slots;
  distinct.samples = rows();
  distinct.blockOfSample = blockOfSample_;
  distinct.positions = positions_;
  distinct.texelCapacity = capacity_.texels;
  distinct.marks = marks_;
  distinct.ranks = ranks_;
  distinct.firstTexel = firstTexel_;
  distinct.texelPositions = texelPositions_;
  device_.run(distinct);
  model_.attributes().forward(texels_, capacity_.training && options.keepAttributes);
  VirtualGridForward mix{model_.virtualGrid()};
  mix.samples = rows();
  mix.blockOfSample = blockOfSample_;
  mix.positions = positions_;
  mix.marks = marks_;
  mix.ranks = ranks_;
  mix.texels = {capacity_.texels, firstTexel_.part(slots, 1)};
  mix.attributes = texels_.outputs;
  mix.minAlpha = options.minAlpha;
  mix.runtimeSteps = runtimeSteps_;
  mix.logDensities = logDensities_;
  mix.colours = colours_;
  device_.run(mix);
}

void VolumePipeline::composite(const VolumeRays& rays) {
  CompositeForward whole;  // for the weights of samples over their whole ray
  whole.minTransmittance = 0;
  whole.rays = {rays.count};
  whole.firstSample = firstSample_;
  whole.x = Matrix<float>(logDensities_, 1);
  whole.steps = steps_;
  whole.opacity = rayOpacity_;
  whole.weights = weights_;
  device_.run(whole);
  CompositeForward ofBlocks = whole;
  ofBlocks.rays = segments();
  ofBlocks.firstSample = firstSampleOfSegment_;
  ofBlocks.distances = distances_;
  ofBlocks.colours = Matrix<float>(colours_, kColours);
  ofBlocks.colour = composited_;
  ofBlocks.opacity = segmentOpacity_;
  ofBlocks.depth = segmentDepth_;
  ofBlocks.weights = segmentWeights_;
  device_.run(ofBlocks);
  device_.run(DeferredForward{segments(), composited_, groupOfSegment_, rayOfSegment_, rays.directions,
                              model_.deferred().values, specular_});
  device_.run(BlendForward{model_.config().literalEq3,
                           {rays.count},
                           firstSegment_,
                           composited_,
                           specular_,
                           segmentOpacity_,
                           segmentDepth_,
                           colour_,
                           opacity_,
                           depth_});
}

void VolumePipeline::backward(const VolumeRays& rays, Slice<const float> colourGradients,
                              Slice<const float> opacityGradients, const LossScales& scales) {
  device_.fillZero(losses_.all());
  backwardThroughBlocks(rays, colourGradients, opacityGradients, scales);
  if (keptAttributes_) backwardThroughTexels(scales);
  if (keptProposals_) backwardThroughProposals(rays, scales);
}

void VolumePipeline::backwardThroughBlocks(const VolumeRays& rays, Slice<const float> colourGradients,
                                           Slice<const float> opacityGradients, const LossScales& scales) {
  device_.run(BlendBackward{model_.config().literalEq3,
                            {rays.count},
                            firstSegment_,
                            composited_,
                            specular_,
                            segmentOpacity_,
                            colourGradients,
                            opacityGradients,
                            compositedGradients_,
                            specularGradients_,
                            segmentOpacityGradients_});
  if (scales.opacity > 0) {
    device_.run(OpacityLoss{scales.opacity, segments(), segmentOpacity_, losses_.part(2, 1), segmentOpacityGradients_});
  }
  device_.run(DeferredBackward{segments(), composited_, groupOfSegment_, rayOfSegment_, rays.directions,
                               model_.deferred().values, specularGradients_, compositedGradients_,
                               model_.deferred().gradients});
  CompositeBackward ofBlocks;
  ofBlocks.minTransmittance = 0;
  ofBlocks.rays = segments();
  ofBlocks.firstSample = firstSampleOfSegment_;
  ofBlocks.x = Matrix<float>(logDensities_, 1);
  ofBlocks.steps = steps_;
  ofBlocks.colours = Matrix<float>(colours_, kColours);
  ofBlocks.rayColourGradients = compositedGradients_;
  ofBlocks.rayOpacityGradients = segmentOpacityGradients_;
  ofBlocks.fullGradientDistance = static_cast<float>(model_.config().fullGradientDistance);
  ofBlocks.distances = distances_;
  ofBlocks.xGradients = logDensityGradients_;
  ofBlocks.colourGradients = Matrix<float>(colourGradients_, kColours);
  device_.run(ofBlocks);
  if (scales.distortion <= 0) return;
  DistortionLoss distortion;
  distortion.scale = scales.distortion;
  distortion.normalised = true;
  distortion.rays = {rays.count};
  distortion.firstSample = firstSample_;
  distortion.weights = weights_;
  distortion.distances = middles_;
  distortion.steps = widths_;
  distortion.loss = losses_.part(0, 1);
  distortion.weightGradients = weightGradients_;
  device_.run(distortion);
  CompositeBackward whole;
  whole.minTransmittance = 0;
  whole.rays = {rays.count};
  whole.firstSample = firstSample_;
  whole.x = ofBlocks.x;
  whole.steps = steps_;
  whole.weightGradients = weightGradients_;
  whole.addToXGradients = true;
  whole.xGradients = logDensityGradients_;
  device_.run(whole);
}

void VolumePipeline::backwardThroughTexels(const LossScales& scales) {
  if (capacity_.points > 0) {
    const Slice<float> ofPoints = logDensityGradients_.part(0, capacity_.points);
    if (scales.sparsity > 0) {
      device_.run(SparsityLoss{
          scales.sparsity, {capacity_.points}, logDensities_, runtimeSteps_, losses_.part(1, 1), ofPoints});
    } else {
      device_.fillZero(ofPoints);
    }
    device_.fillZero(colourGradients_.part(0, size_t{kColours} * capacity_.points));
  }
  const uint32_t slots = model_.slots();
  VirtualGridBackward mix{model_.virtualGrid()};
  mix.blocks = slots;
  mix.samples = rows();
  mix.blockOfSample = blockOfSample_;
  mix.positions = positions_;
  mix.marks = marks_;
  mix.ranks = ranks_;
  mix.firstTexel = firstTexel_;
  mix.texels = {capacity_.texels, firstTexel_.part(slots, 1)};
  mix.logDensities = logDensities_;
  mix.colours = colours_;
  mix.logDensityGradients = logDensityGradients_;
  mix.colourGradients = colourGradients_;
  mix.attributeGradients = texels_.outputGradients;
  device_.run(mix);
  model_.attributes().backward(texels_);
}

void VolumePipeline::backwardThroughProposals(const VolumeRays& rays, const LossScales& scales) {
  for (uint32_t r = 0; r < rounds(); ++r) {
    Round& round = round_[r];
    InterlevelLoss interlevel;
    interlevel.scale = scales.interlevel;
    interlevel.rays = {rays.count};
    interlevel.intervals = round.intervals;
    interlevel.fences = round.fences;
    interlevel.weights = round.weights;
    interlevel.firstSample = firstSample_;
    interlevel.middles = middles_;
    interlevel.widths = widths_;
    interlevel.sampleWeights = weights_;
    interlevel.loss = losses_.part(3 + r, 1);
    interlevel.weightGradients = round.weightGradients;
    device_.run(interlevel);
    CompositeBackward weights;
    weights.minTransmittance = 0;
    weights.rays = {rays.count};
    weights.firstSample = round.firstSample;
    weights.x = Matrix<float>(round.logDensities, 1);
    weights.steps = round.steps;
    weights.weightGradients = round.weightGradients;
    weights.xGradients = round.gradients;
    device_.run(weights);
    const Count rows{rays.count * round.intervals};
    device_.run(GatherRows{rows, round.source, Matrix<float>(round.gradients, 1),
                           Matrix<float>(round.batch.outputGradients, 1)});
    model_.proposals().backward(round.batch);
  }
}

}  // namespace tessera
