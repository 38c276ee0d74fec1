#include "compute/attention.h"

#include <algorithm>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

constexpr size_t kFeatures = AttentionShape::kFeatures, kCoarse = 16;

double sigmoid(double x) {
  return 1 / (1 + std::exp(-x));
}

// The index of the logit that weights a feature of a level; not to be used with AttentionWeights::none.
size_t logitIndex(const AttentionShape& shape, size_t level, size_t feature) {
  return shape.weights == AttentionWeights::shared ? level : 2 * level + (feature > 0 ? 1 : 0);
}

// The inputs as row-major arrays without gaps.
struct Inputs {
  Doubles coarse, fine, logits;

  template <class Arguments>
  explicit Inputs(const Arguments& a) {
    const size_t samples = hostCount(a.samples);
    coarse = doubles(a.coarse, samples);
    fine = doubles(a.fine, samples);
    logits = doubles(a.logits, a.logits.count);
  }
  View coarseRow(size_t s) const { return View(coarse).subspan(kCoarse * s, kCoarse); }
  View fineRow(size_t s, uint32_t levels) const {
    return View(fine).subspan(kFeatures * levels * s, kFeatures * levels);
  }
  View logitRow(const AttentionShape& shape, size_t s) const {
    return shape.varies ? coarseRow(s).subspan(kFeatures, shape.logits()) : View(logits);
  }
};

}  // namespace

Doubles fusedFeatures(const AttentionShape& shape, View coarse, View fine, View logits) {
  Doubles features(coarse.begin(), coarse.begin() + kFeatures);
  for (size_t l = 0; l < shape.levels; ++l) {
    for (size_t f = 0; f < kFeatures; ++f) {
      const bool weighed = shape.weights != AttentionWeights::none;
      features[f] += (weighed ? sigmoid(logits[logitIndex(shape, l, f)]) : 1) * fine[kFeatures * l + f];
    }
  }
  return features;
}

Point shadedColour(const double diffuse[3], const double specular[3], double opacity) {
  Point colour;
  for (int c = 0; c < 3; ++c) colour[c] = opacity * sigmoid(diffuse[c] + specular[c]);
  return colour;
}

void run(const AttentionForward& a) {
  const size_t samples = hostCount(a.samples);
  const Inputs inputs(a);
  Doubles features;
  for (size_t s = 0; s < samples; ++s) {
    Doubles fused =
        fusedFeatures(a.shape, inputs.coarseRow(s), inputs.fineRow(s, a.shape.levels), inputs.logitRow(a.shape, s));
    fused[0] = std::min<double>(fused[0], AttentionShape::kMaxDensity);
    features.insert(features.end(), fused.begin(), fused.end());
  }
  store(a.features, features);
}

void run(const AttentionBackward& a) {
  const AttentionShape& shape = a.shape;
  const size_t samples = hostCount(a.samples);
  const Inputs inputs(a);
  const Doubles ofDensity = doubles(a.logDensityGradients, samples), ofColours = doubles(a.colourGradients, samples);
  Doubles coarse, fine, logits(shape.varies ? 0 : shape.logits());
  for (size_t s = 0; s < samples; ++s) {
    const View fineRow = inputs.fineRow(s, shape.levels), logitRow = inputs.logitRow(shape, s);
    Doubles own(kCoarse);
    for (size_t f = 0; f < kFeatures; ++f) own[f] = f == 0 ? ofDensity[s] : ofColours[(kFeatures - 1) * s + f - 1];
    for (size_t l = 0; l < shape.levels; ++l) {
      for (size_t f = 0; f < kFeatures; ++f) {
        double weight = 1;
        if (shape.weights != AttentionWeights::none) {
          const size_t logit = logitIndex(shape, l, f);
          weight = sigmoid(logitRow[logit]);
          const double slope = own[f] * fineRow[kFeatures * l + f] * weight * (1 - weight);
          (shape.varies ? own[kFeatures + logit] : logits[logit]) += slope;
        }
        fine.push_back(weight * own[f]);
      }
    }
    coarse.insert(coarse.end(), own.begin(), own.end());
  }
  store(a.coarseGradients, coarse);
  store(a.fineGradients, fine);
  if (!logits.empty()) add(a.logitGradients, logits);
}

void run(const ShadeForward& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles diffuse = doubles(a.diffuse, rays), specular = doubles(a.specular, rays);
  const Doubles opacity = doubles(a.opacity, rays);
  Doubles colours;
  for (size_t r = 0; r < rays; ++r) {
    const Point colour = shadedColour(&diffuse[3 * r], &specular[3 * r], a.whole ? 1 : opacity[r]);
    colours.insert(colours.end(), colour.begin(), colour.end());
  }
  store(a.colour, colours);
}

void run(const ShadeBackward& a) {
  const size_t rays = hostCount(a.rays);
  const Doubles diffuse = doubles(a.diffuse, rays), specular = doubles(a.specular, rays);
  const Doubles opacity = doubles(a.opacity, rays), upstream = doubles(a.colourGradients, 3 * rays);
  Doubles sums, opacities;
  for (size_t r = 0; r < rays; ++r) {
    double ofOpacity = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double colour = sigmoid(diffuse[3 * r + c] + specular[3 * r + c]);
      sums.push_back(upstream[3 * r + c] * (a.whole ? 1 : opacity[r]) * colour * (1 - colour));
      ofOpacity += upstream[3 * r + c] * colour;
    }
    opacities.push_back(ofOpacity);
  }
  store(a.sumGradients, sums);
  if (!a.whole) add(a.opacityGradients, opacities);
}

}  // namespace tessera::reference
