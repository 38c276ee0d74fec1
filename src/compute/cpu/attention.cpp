#include "compute/attention.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kFeatures = AttentionShape::kFeatures, kRowsPerTask = 2048;
constexpr size_t kMaxLogits = 2 * AttentionShape::kMaxLevels;

float sigmoid(float x) {
  return 1 / (1 + std::exp(-x));
}

// The weights of density and of colours of each level.
struct Weights {
  float density[AttentionShape::kMaxLevels], colours[AttentionShape::kMaxLevels];

  Weights(const AttentionShape& shape, const float* logits) {
    for (uint32_t l = 0; l < shape.levels; ++l) {
      density[l] = colours[l] = 1;
      if (shape.weights == AttentionWeights::none) continue;
      const bool shared = shape.weights == AttentionWeights::shared;
      density[l] = sigmoid(logits[shared ? l : 2 * l]);
      colours[l] = shared ? density[l] : sigmoid(logits[2 * l + 1]);
    }
  }
};

// The weights of the whole model, if they do not vary.
template <class Arguments>
Weights sharedWeights(const Arguments& a) {
  const AttentionShape& shape = a.shape;
  CHECK(shape.levels <= AttentionShape::kMaxLevels);
  static constexpr float kNone[kMaxLogits] = {};
  return Weights(shape, shape.varies || shape.logits() == 0 ? kNone : hostPointer(a.logits));
}

}  // namespace

void run(Context& context, const AttentionForward& a) {
  const AttentionShape& shape = a.shape;
  const Weights ofModel = sharedWeights(a);
  const float* coarse = hostPointer(a.coarse.data);
  const float* fine = hostPointer(a.fine.data);
  float* features = hostPointer(a.features.data);
  context.pool.forRanges(hostCount(a.samples), kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t s = begin; s < end; ++s) {
      const Weights weights = shape.varies ? Weights(shape, coarse + a.coarse.offset(s, kFeatures)) : ofModel;
      const float* base = coarse + a.coarse.offset(s, 0);
      float sum[kFeatures];
      for (size_t f = 0; f < kFeatures; ++f) sum[f] = base[f];
      for (uint32_t l = 0; l < shape.levels; ++l) {
        const float* level = fine + a.fine.offset(s, kFeatures * l);
        sum[0] += weights.density[l] * level[0];
        for (size_t f = 1; f < kFeatures; ++f) sum[f] += weights.colours[l] * level[f];
      }
      sum[0] = std::min(sum[0], AttentionShape::kMaxDensity);
      std::copy_n(sum, kFeatures, features + a.features.offset(s, 0));
    }
  });
}

void run(Context& context, const AttentionBackward& a) {
  const AttentionShape& shape = a.shape;
  const Weights ofModel = sharedWeights(a);
  const float* coarse = hostPointer(a.coarse.data);
  const float* fine = hostPointer(a.fine.data);
  const float* ofDensity = hostPointer(a.logDensityGradients);
  const float* ofColours = hostPointer(a.colourGradients.data);
  float* coarseGradients = hostPointer(a.coarseGradients.data);
  float* fineGradients = hostPointer(a.fineGradients.data);
  const size_t samples = hostCount(a.samples);
  const bool shared = shape.weights == AttentionWeights::shared;
  std::vector<float> logitSums((samples + kRowsPerTask - 1) / kRowsPerTask * kMaxLogits);  // one set per task
  context.pool.forRanges(samples, kRowsPerTask, [&](size_t begin, size_t end) {
    float* logitSum = &logitSums[begin / kRowsPerTask * kMaxLogits];
    for (size_t s = begin; s < end; ++s) {
      const Weights weights = shape.varies ? Weights(shape, coarse + a.coarse.offset(s, kFeatures)) : ofModel;
      float own[kFeatures], logits[kMaxLogits] = {};
      own[0] = ofDensity[s];
      std::copy_n(ofColours + a.colourGradients.offset(s, 0), kFeatures - 1, own + 1);
      for (uint32_t l = 0; l < shape.levels; ++l) {
        const float* level = fine + a.fine.offset(s, kFeatures * l);
        float* levelGradients = fineGradients + a.fineGradients.offset(s, kFeatures * l);
        const float density = weights.density[l], colours = weights.colours[l];
        levelGradients[0] = density * own[0];
        float dot = 0;
        for (size_t f = 1; f < kFeatures; ++f) {
          levelGradients[f] = colours * own[f];
          dot += own[f] * level[f];
        }
        if (shape.weights == AttentionWeights::none) continue;
        const float ofDensityWeight = own[0] * level[0] * density * (1 - density);
        const float ofColourWeight = dot * colours * (1 - colours);
        if (shared) {
          logits[l] = ofDensityWeight + ofColourWeight;
        } else {
          logits[2 * l] = ofDensityWeight;
          logits[2 * l + 1] = ofColourWeight;
        }
      }
      std::copy_n(own, kFeatures, coarseGradients + a.coarseGradients.offset(s, 0));
      if (!shape.varies) {
        for (size_t i = 0; i < kMaxLogits; ++i) logitSum[i] += std::exchange(logits[i], 0.0f);
      }
      std::copy_n(logits, kMaxLogits, coarseGradients + a.coarseGradients.offset(s, kFeatures));
    }
  });
  if (shape.varies || shape.logits() == 0) return;
  float* logitGradients = hostPointer(a.logitGradients);
  for (size_t i = 0; i < logitSums.size(); ++i) {
    if (i % kMaxLogits < shape.logits()) logitGradients[i % kMaxLogits] += logitSums[i];
  }
}

void run(Context& context, const ShadeForward& a) {
  const float* diffuse = hostPointer(a.diffuse.data);
  const float* specular = hostPointer(a.specular.data);
  const float* opacity = hostPointer(a.opacity);
  float* colour = hostPointer(a.colour);
  context.pool.forRanges(hostCount(a.rays), kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      for (size_t c = 0; c < 3; ++c) {
        const float sum = diffuse[a.diffuse.offset(r, c)] + specular[a.specular.offset(r, c)];
        colour[3 * r + c] = (a.whole ? 1 : opacity[r]) * sigmoid(sum);
      }
    }
  });
}

void run(Context& context, const ShadeBackward& a) {
  const float* diffuse = hostPointer(a.diffuse.data);
  const float* specular = hostPointer(a.specular.data);
  const float* opacity = hostPointer(a.opacity);
  const float* upstream = hostPointer(a.colourGradients);
  float* sums = hostPointer(a.sumGradients.data);
  float* opacityGradients = hostPointer(a.opacityGradients);
  context.pool.forRanges(hostCount(a.rays), kRowsPerTask, [&](size_t begin, size_t end) {
    for (size_t r = begin; r < end; ++r) {
      float ofOpacity = 0;
      for (size_t c = 0; c < 3; ++c) {
        const float colour = sigmoid(diffuse[a.diffuse.offset(r, c)] + specular[a.specular.offset(r, c)]);
        sums[a.sumGradients.offset(r, c)] = upstream[3 * r + c] * (a.whole ? 1 : opacity[r]) * colour * (1 - colour);
        ofOpacity += upstream[3 * r + c] * colour;
      }
      if (!a.whole) opacityGradients[r] += ofOpacity;
    }
  });
}

}  // namespace tessera::cpu
