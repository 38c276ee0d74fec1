#include "export/mobilenerf_refit.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/random.h"
#include "compute/adam.h"
#include "compute/cpu/device.h"
#include "compute/losses.h"
#include "compute/mlp.h"
#include "scene/spherical_harmonics.h"

namespace tessera {

struct RefitCandidate {
  uint64_t key;  // random: those with the least keys are kept
  RefitTexel texel;
};

namespace {

constexpr size_t kTexelsToKeep = 1 << 17, kLeastTexels = 512;  // of all decoders together, of each
constexpr uint32_t kRowsOfStep = 8192, kLeastRows = 16;
constexpr size_t kHeldOut = 8;  // every eighth texel
constexpr size_t kTexelsAtATime = 1 << 14;
constexpr float kFirstRate = 5e-3f, kLastRate = 1e-4f;
// With an input that is always 1, as networks have no biases.
constexpr uint32_t kEncoderInputs = kMeshFeatures + 1, kNetworkInputs = kViewerInputs + 1;

// The features of a texel, normalised → the viewer's, 0 to 1.
const MlpShape kEncoderShape{.inputs = kEncoderInputs,
                             .width = 64,
                             .hiddenLayers = 1,
                             .outputs = kViewerFeatures,
                             .activation = OutputActivation::sigmoid};
const MlpShape kViewerShape{
    .inputs = kNetworkInputs, .width = 16, .hiddenLayers = 2, .outputs = 3, .activation = OutputActivation::sigmoid};

// Random weights with which the outputs of a layer vary about as much as its inputs.
std::vector<float> startingWeights(const MlpShape& shape, uint64_t seed) {
  std::vector<float> weights(shape.parameters());
  const RandomStream random(seed, 0x6d62);
  uint64_t next = 0;
  for (int layer = 0; layer < shape.layers(); ++layer) {
    const int inputs = layer == 0 ? shape.inputs : shape.width,
              outputs = layer + 1 == shape.layers() ? shape.outputs : shape.width;
    const float bound = std::sqrt((layer + 1 == shape.layers() ? 3.0f : 6.0f) / static_cast<float>(inputs));
    for (int output = 0; output < outputs; ++output)
      for (int input = 0; input < inputs; ++input)
        weights[shape.weightOffset(layer) + static_cast<size_t>(output * shape.layerInputs(layer) + input)] =
            bound * (2 * random.uniform(next++) - 1);
  }
  return weights;
}

// Evaluates layers with ReLU between them and a sigmoid after the last.
std::array<float, 3> evaluateColour(const std::vector<DenseLayer>& layers, std::span<const float> inputs) {
  std::array<std::array<float, kMaxLayerWidth>, 2> values{};
  std::copy(inputs.begin(), inputs.end(), values[0].begin());
  for (size_t i = 0; i < layers.size(); ++i) {
    const DenseLayer& layer = layers[i];
    const auto& from = values[i % 2];
    auto& to = values[(i + 1) % 2];
    for (uint32_t output = 0; output < layer.outputs; ++output) {
      float sum = layer.biases[output];
      const float* const weights = layer.weights.data() + size_t{output} * layer.inputs;
      for (uint32_t input = 0; input < layer.inputs; ++input) sum += weights[input] * from[input];
      to[output] = i + 1 == layers.size() ? 1 / (1 + std::exp(-sum)) : std::max(0.0f, sum);
    }
  }
  const auto& last = values[layers.size() % 2];
  return {last[0], last[1], last[2]};
}

// The colour that a decoder of the scene gives.
std::array<float, 3> decodedColour(const std::vector<DenseLayer>& decoder, const RefitTexel& texel, size_t direction) {
  std::array<float, kMeshFeatures + kMeshHarmonics> inputs;
  std::copy(texel.features.begin(), texel.features.end(), inputs.begin());
  const auto& d = texel.directions[direction];
  const auto harmonics = evaluateHarmonics(Vec3d(d[0], d[1], d[2]));
  std::copy_n(harmonics.begin(), kMeshHarmonics, inputs.begin() + kMeshFeatures);
  return evaluateColour(decoder, inputs);
}

// How many texels of a decoder are kept.
size_t texelLimit(size_t decoders) {
  return std::max(kLeastTexels, kTexelsToKeep / decoders);
}

void keepLeast(std::vector<RefitCandidate>& candidates, size_t count) {
  if (candidates.size() <= count) return;
  const auto isLess = [](const RefitCandidate& a, const RefitCandidate& b) { return a.key < b.key; };
  std::nth_element(candidates.begin(), candidates.begin() + static_cast<ptrdiff_t>(count), candidates.end(), isLess);
  candidates.resize(count);
}

}  // namespace

uint8_t encodeViewerFeature(uint32_t feature, float value) {
  const bool isAlpha = feature % 4 == 3;
  const float number = isAlpha ? (255 * value - 1) / 2 : 255 * value, least = feature == 0 ? 1 : 0;
  const float byte = std::floor(std::min(std::max(number + 0.5f, least), isAlpha ? 127.0f : 255.0f));
  return static_cast<uint8_t>(isAlpha ? 128 + byte : byte);
}

float decodeViewerFeature(uint32_t feature, uint8_t byte) {
  const float value = static_cast<float>(byte) / 255;
  return feature % 4 == 3 ? 2 * value - 1 : value;
}

struct ViewerRefit::Weights {
  Array<float> values, gradients, firstMoments, secondMoments;
  Array<uint32_t> counts;

  Weights(Device& device, const MlpShape& shape, uint64_t seed)
      : values(device.uploadArray(startingWeights(shape, seed))),
        gradients(device.array<float>(shape.parameters())),
        firstMoments(device.array<float>(shape.parameters())),
        secondMoments(device.array<float>(shape.parameters())),
        counts(device.array<uint32_t>(shape.parameters())) {}

  void step(Device& device, float rate) {
    device.run(Adam{.rate = rate,
                    .parameters = values,
                    .gradients = gradients,
                    .firstMoments = firstMoments,
                    .secondMoments = secondMoments,
                    .counts = counts});
  }
};

struct ViewerRefit::Encoder {
  std::vector<DenseLayer> decoder;
  uint64_t seen = 0, largestKey = UINT64_MAX;  // of those that may still be kept
  std::vector<RefitCandidate> candidates;
  std::array<float, kMeshFeatures> mean{}, scale{};
  std::unique_ptr<Weights> weights;
  std::vector<std::array<std::array<float, 3>, RefitTexel::kDirections>> colours;  // of the candidates
  size_t trained = 0;  // candidates from here on are left out of training
  uint32_t firstRow = 0, rows = 0;
  Array<float> activations;

  void normalise(std::span<const float> features, float* inputs) const {
    for (size_t f = 0; f < kMeshFeatures; ++f) inputs[f] = (features[f] - mean[f]) * scale[f];
    inputs[kMeshFeatures] = 1;
  }
};

struct ViewerRefit::Batch {
  uint32_t rows;
  // On the device: inputs and outputs of all encoders, one after another, and of the viewer's network.
  Array<float> encoderInputs, features, viewerInputs, viewerActivations, colours, targets, weights, loss, gradients,
      inputGradients;
  std::vector<float> encoderNumbers, viewerNumbers, targetNumbers, weightNumbers;  // written to them

  Batch(Device& device, uint32_t count)
      : rows(count),
        encoderInputs(device.array<float>(size_t{count} * kEncoderInputs)),
        features(device.array<float>(size_t{count} * kViewerFeatures)),
        viewerInputs(device.array<float>(size_t{count} * kNetworkInputs)),
        viewerActivations(device.allocateActivations(kViewerShape, count)),
        colours(device.array<float>(size_t{3} * count)),
        targets(device.array<float>(size_t{3} * count)),
        weights(device.array<float>(count)),
        loss(device.array<float>(2)),
        gradients(device.array<float>(size_t{3} * count)),
        inputGradients(device.array<float>(size_t{count} * kNetworkInputs)),
        encoderNumbers(encoderInputs.size()),
        viewerNumbers(viewerInputs.size()),
        targetNumbers(targets.size()),
        weightNumbers(count) {}

  Matrix<float> byRow(Array<float>& array, uint32_t columns, const Encoder& encoder) {
    return Matrix<float>(array, columns).rowsFrom(encoder.firstRow);
  }
};

ViewerRefit::ViewerRefit(int threads) : pool_(threads), device_(makeCpuDevice(threads)) {}
ViewerRefit::~ViewerRefit() = default;

uint32_t ViewerRefit::numberDecoder(const std::vector<DenseLayer>& decoder) {
  const auto same = std::find_if(encoders_.begin(), encoders_.end(),
                                 [&](const auto& encoder) { return encoder->decoder == decoder; });
  if (same != encoders_.end()) return static_cast<uint32_t>(same - encoders_.begin());
  encoders_.push_back(std::make_unique<Encoder>());
  encoders_.back()->decoder = decoder;
  return static_cast<uint32_t>(encoders_.size() - 1);
}

uint32_t ViewerRefit::decoders() const {
  return static_cast<uint32_t>(encoders_.size());
}

void ViewerRefit::add(uint32_t decoder, const RefitTexel& texel) {
  Encoder& encoder = *encoders_[decoder];
  ++encoder.seen;
  const uint64_t key = RandomStream(0x6d6f62).bits(added_++);
  if (key > encoder.largestKey) return;
  encoder.candidates.push_back({key, texel});
  const size_t limit = texelLimit(encoders_.size());
  if (encoder.candidates.size() < 2 * limit) return;
  keepLeast(encoder.candidates, limit);
  encoder.largestKey = 0;
  for (const RefitCandidate& one : encoder.candidates) encoder.largestKey = std::max(encoder.largestKey, one.key);
}

void ViewerRefit::begin() {
  uint64_t seen = 0, number = 0;
  for (const auto& encoder : encoders_) seen += encoder->seen;
  CHECK(seen > 0u);
  for (const auto& encoder : encoders_) {
    std::vector<RefitCandidate>& texels = encoder->candidates;
    keepLeast(texels, texelLimit(encoders_.size()));
    std::sort(texels.begin(), texels.end(), [](const auto& a, const auto& b) { return a.key < b.key; });
    encoder->trained = texels.size() - texels.size() / kHeldOut;
    for (size_t f = 0; f < kMeshFeatures && !texels.empty(); ++f) {
      double sum = 0, squares = 0;
      for (const RefitCandidate& one : texels) sum += double{one.texel.features[f]};
      const double mean = sum / static_cast<double>(texels.size());
      for (const RefitCandidate& one : texels) squares += std::pow(double{one.texel.features[f]} - mean, 2);
      const double deviation = std::sqrt(squares / static_cast<double>(texels.size()));
      encoder->mean[f] = static_cast<float>(mean);
      encoder->scale[f] = deviation > 1e-6 ? static_cast<float>(1 / deviation) : 0;
    }
    encoder->colours.resize(texels.size());
    pool_.forRanges(texels.size(), 256, [&](size_t first, size_t end) {
      for (size_t i = first; i < end; ++i)
        for (size_t d = 0; d < RefitTexel::kDirections; ++d)
          encoder->colours[i][d] = decodedColour(encoder->decoder, texels[i].texel, d);
    });
    encoder->weights = std::make_unique<Weights>(*device_, kEncoderShape, ++number);
  }
  viewer_ = std::make_unique<Weights>(*device_, kViewerShape, 0);
  // As many rows for each decoder as it has texels in the scene, in multiples of kLeastRows.
  uint32_t rows = 0;
  for (const auto& encoder : encoders_) {
    encoder->firstRow = rows;
    if (encoder->seen == 0) continue;
    const double share = static_cast<double>(encoder->seen) / static_cast<double>(seen);
    encoder->rows = kLeastRows * std::max(1u, static_cast<uint32_t>(share * kRowsOfStep / kLeastRows + 0.5));
    encoder->activations = device_->allocateActivations(kEncoderShape, encoder->rows);
    rows += encoder->rows;
  }
}

// Draws texels and directions.
void ViewerRefit::fill(Batch& batch, int number) {
  for (size_t k = 0; k < encoders_.size(); ++k) {
    const Encoder& encoder = *encoders_[k];
    const RandomStream random(static_cast<uint64_t>(number), k);
    for (uint32_t i = 0; i < encoder.rows; ++i) {
      const size_t row = encoder.firstRow + i;
      const uint32_t drawn = random.below(i, static_cast<uint32_t>(encoder.trained * RefitTexel::kDirections));
      const size_t candidate = drawn / RefitTexel::kDirections, direction = drawn % RefitTexel::kDirections;
      const RefitTexel& texel = encoder.candidates[candidate].texel;
      encoder.normalise(texel.features, batch.encoderNumbers.data() + row * kEncoderInputs);
      float* const inputs = batch.viewerNumbers.data() + row * kNetworkInputs + kViewerFeatures;
      std::copy(texel.directions[direction].begin(), texel.directions[direction].end(), inputs);
      inputs[3] = 1;
      std::copy_n(encoder.colours[candidate][direction].begin(), 3, batch.targetNumbers.data() + 3 * row);
      batch.weightNumbers[row] = texel.weights[direction];
    }
  }
  device_->write(batch.encoderInputs.all(), std::span<const float>(batch.encoderNumbers));
  device_->write(batch.targets.all(), std::span<const float>(batch.targetNumbers));
  device_->write(batch.weights.all(), std::span<const float>(batch.weightNumbers));
}

void ViewerRefit::step(Batch& batch, int number, int steps) {
  fill(batch, number);
  for (const auto& encoder : encoders_) {
    if (encoder->rows == 0) continue;
    device_->run(MlpForward{kEncoderShape,
                            {encoder->rows},
                            batch.byRow(batch.encoderInputs, kEncoderInputs, *encoder),
                            encoder->weights->values,
                            batch.byRow(batch.features, kViewerFeatures, *encoder),
                            encoder->activations});
  }
  const std::vector<float> features = device_->read(batch.features.all());
  for (size_t row = 0; row < batch.rows; ++row)
    for (uint32_t f = 0; f < kViewerFeatures; ++f)
      batch.viewerNumbers[row * kNetworkInputs + f] =
          decodeViewerFeature(f, encodeViewerFeature(f, features[row * kViewerFeatures + f]));
  device_->write(batch.viewerInputs.all(), std::span<const float>(batch.viewerNumbers));
  const Matrix<float> inputs(batch.viewerInputs, kNetworkInputs), colours(batch.colours, 3);
  device_->run(MlpForward{kViewerShape, {batch.rows}, inputs, viewer_->values, colours, batch.viewerActivations});
  device_->run(ColourLoss{.kind = ColourLossKind::mse,
                          .scale = 1 / (3 * static_cast<float>(batch.rows)),
                          .rays = {batch.rows},
                          .predicted = batch.colours,
                          .target = batch.targets,
                          .weights = batch.weights,
                          .loss = batch.loss,
                          .gradients = batch.gradients});
  const Matrix<float> inputGradients(batch.inputGradients, kNetworkInputs);
  device_->run(MlpBackward{kViewerShape,
                           {batch.rows},
                           inputs,
                           viewer_->values,
                           colours,
                           batch.viewerActivations,
                           Matrix<float>(batch.gradients, 3),
                           {},
                           viewer_->gradients,
                           inputGradients});
  const float rate =
      kFirstRate * std::pow(kLastRate / kFirstRate, static_cast<float>(number) / static_cast<float>(steps));
  for (const auto& encoder : encoders_) {
    if (encoder->rows == 0) continue;
    device_->run(MlpBackward{kEncoderShape,
                             {encoder->rows},
                             batch.byRow(batch.encoderInputs, kEncoderInputs, *encoder),
                             encoder->weights->values,
                             batch.byRow(batch.features, kViewerFeatures, *encoder),
                             encoder->activations,
                             inputGradients.columnRange(0, kViewerFeatures).rowsFrom(encoder->firstRow),
                             {},
                             encoder->weights->gradients,
                             {}});
    encoder->weights->step(*device_, rate);
  }
  viewer_->step(*device_, rate);
}

RefitError ViewerRefit::train(int steps) {
  begin();
  {
    Batch batch(*device_, encoders_.back()->firstRow + encoders_.back()->rows);
    for (int number = 0; number < steps; ++number) step(batch, number, steps);
    device_->finish();
  }
  const RefitError error = judge();
  for (const auto& encoder : encoders_) {
    encoder->candidates = {};
    encoder->colours = {};
  }
  return error;
}

std::vector<uint8_t> ViewerRefit::encode(uint32_t decoder, std::span<const float> features) {
  const Encoder& encoder = *encoders_[decoder];
  const size_t texels = features.size() / kMeshFeatures;
  std::vector<uint8_t> bytes(texels * kViewerFeatures);
  const size_t atATime = std::min(texels, kTexelsAtATime);
  Array<float> inputs = device_->array<float>(atATime * kEncoderInputs),
               outputs = device_->array<float>(atATime * kViewerFeatures);
  std::vector<float> numbers(inputs.size());
  for (size_t first = 0; first < texels; first += atATime) {
    const size_t count = std::min(atATime, texels - first);
    for (size_t i = 0; i < count; ++i)
      encoder.normalise(features.subspan((first + i) * kMeshFeatures, kMeshFeatures),
                        numbers.data() + i * kEncoderInputs);
    device_->write(inputs.all(), std::span<const float>(numbers));
    device_->run(MlpForward{kEncoderShape,
                            {static_cast<uint32_t>(count)},
                            Matrix<float>(inputs, kEncoderInputs),
                            encoder.weights->values,
                            Matrix<float>(outputs, kViewerFeatures),
                            {}});
    const std::vector<float> values = device_->read(outputs.part(0, count * kViewerFeatures));
    for (size_t i = 0; i < values.size(); ++i)
      bytes[first * kViewerFeatures + i] = encodeViewerFeature(i % kViewerFeatures, values[i]);
  }
  return bytes;
}

std::vector<DenseLayer> ViewerRefit::network() const {
  const std::vector<float> weights = device_->read(viewer_->values.all());
  std::vector<DenseLayer> layers;
  for (int number = 0; number < kViewerShape.layers(); ++number) {
    DenseLayer layer;
    layer.inputs = number == 0 ? kViewerInputs : static_cast<uint32_t>(kViewerShape.width);
    layer.outputs = static_cast<uint32_t>(number + 1 == kViewerShape.layers() ? 3 : kViewerShape.width);
    for (uint32_t output = 0; output < layer.outputs; ++output) {
      const float* const row = weights.data() + kViewerShape.weightOffset(number) +
                               output * static_cast<size_t>(kViewerShape.layerInputs(number));
      layer.weights.insert(layer.weights.end(), row, row + layer.inputs);
      layer.biases.push_back(number == 0 ? row[kViewerInputs] : 0);
    }
    layers.push_back(std::move(layer));
  }
  return layers;
}

RefitError ViewerRefit::judge() {
  const std::vector<DenseLayer> layers = network();
  const bool isAnyHeldOut = std::any_of(encoders_.begin(), encoders_.end(), [](const auto& encoder) {
    return encoder->trained < encoder->candidates.size();
  });
  double squares = 0, weights = 0;
  RefitError error;
  for (uint32_t k = 0; k < encoders_.size(); ++k) {
    const Encoder& encoder = *encoders_[k];
    const size_t first = isAnyHeldOut ? encoder.trained : 0, count = encoder.candidates.size() - first;
    if (count == 0) continue;
    std::vector<float> features;
    for (size_t i = 0; i < count; ++i) {
      const auto& one = encoder.candidates[first + i].texel.features;
      features.insert(features.end(), one.begin(), one.end());
    }
    const std::vector<uint8_t> bytes = encode(k, features);
    double ownSquares = 0, ownWeights = 0;
    for (size_t i = 0; i < count; ++i) {
      const RefitTexel& texel = encoder.candidates[first + i].texel;
      std::array<float, kViewerInputs> inputs;
      for (uint32_t f = 0; f < kViewerFeatures; ++f) inputs[f] = decodeViewerFeature(f, bytes[i * kViewerFeatures + f]);
      for (size_t d = 0; d < RefitTexel::kDirections; ++d) {
        std::copy(texel.directions[d].begin(), texel.directions[d].end(), inputs.begin() + kViewerFeatures);
        const std::array<float, 3> colour = evaluateColour(layers, inputs);
        for (size_t c = 0; c < 3; ++c) {
          const double difference = double{colour[c]} - double{encoder.colours[first + i][d][c]};
          ownSquares += double{texel.weights[d]} * difference * difference / 3;
        }
        ownWeights += double{texel.weights[d]};
      }
    }
    // Each decoder counts as much as it has texels in the scene, of which fewer may be kept.
    const double texels = static_cast<double>(encoder.seen) / static_cast<double>(count);
    squares += texels * ownSquares;
    weights += texels * ownWeights;
    error.colours += count * RefitTexel::kDirections;
  }
  error.rms = std::sqrt(squares / std::max(weights, 1e-30));
  error.psnr = -20 * std::log10(std::max(error.rms, 1e-10));
  return error;
}

}  // namespace tessera
