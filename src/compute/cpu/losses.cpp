#include "compute/losses.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/random.h"
#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 256;  // fixed: partial sums are added in task order
constexpr int kGroup = 16;            // rays per 4×4 image of S3IM

struct ValueAndSlope {
  float value, slope;
};

ValueAndSlope robust(ColourLossKind kind, float parameter, float r) {
  switch (kind) {
    case ColourLossKind::mse:
      return {r * r, 2 * r};
    case ColourLossKind::huber:
      if (std::abs(r) <= parameter) return {r * r / (2 * parameter), r / parameter};
      return {std::abs(r) - parameter / 2, r > 0 ? 1.0f : -1.0f};
    case ColourLossKind::charbonnier: {
      const float root = std::sqrt(r * r + parameter * parameter);
      return {root, r / root};
    }
  }
  return {0, 0};
}

// The warp of distances of MERF, g of DistortionLoss.
float warped(float t) {
  return t < 1 ? t / 2 : 1 - 1 / (2 * t);
}

// Σ computeLoss(i) over `count` rays, segments or points, added in a fixed order.
template <class LossOf>
double sumInOrder(ThreadPool& pool, size_t count, const LossOf& computeLoss) {
  const size_t tasks = (count + kRaysPerTask - 1) / kRaysPerTask;
  std::vector<double> sums(tasks);
  pool.run(tasks, [&](size_t task, int) {
    for (size_t i = task * kRaysPerTask; i < std::min(count, (task + 1) * kRaysPerTask); ++i)
      sums[task] += computeLoss(i);
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

struct GroupWeights {
  float of[kGroup];
  GroupWeights() {
    constexpr float kTaps[4] = {.136465f, .265797f, .331941f, .265797f};
    for (int p = 0; p < kGroup; ++p) of[p] = kTaps[p / 4] * kTaps[p % 4];
  }
};

// The SSIM of one channel of a group, and its gradient with respect to x.
float similarity(const float* x, const float* y, const GroupWeights& weights, float* gradients) {
  constexpr float kC1 = 1e-4f, kC2 = 9e-4f;
  float meanX = 0, meanY = 0;
  for (int p = 0; p < kGroup; ++p) {
    meanX += weights.of[p] * x[p];
    meanY += weights.of[p] * y[p];
  }
  float squares = 0, products = 0;
  for (int p = 0; p < kGroup; ++p) {
    const float fromX = x[p] - meanX, fromY = y[p] - meanY;
    squares += weights.of[p] * (fromX * fromX + fromY * fromY);
    products += weights.of[p] * fromX * fromY;
  }
  const float a1 = 2 * meanX * meanY + kC1, a2 = 2 * products + kC2;
  const float b1 = meanX * meanX + meanY * meanY + kC1, b2 = squares + kC2;
  const float all = 1 / (b1 * b2), value = a1 * a2 * all;
  // 2 k_p ((μy A2 + A1 (y_p - μy)) / (B1 B2) - S (μx / B1 + (x_p - μx) / B2)), by powers of x_p and y_p
  const float ofX = 2 * value / b2, ofY = 2 * a1 * all;
  const float constant = 2 * (meanY * a2 * all - value * meanX / b1);
  for (int p = 0; p < kGroup; ++p) {
    gradients[p] = weights.of[p] * (constant + ofY * (y[p] - meanY) - ofX * (x[p] - meanX));
  }
  return value;
}

// The order in which a patch uses the rays, in a buffer that each thread reuses.
const uint32_t* orderOfPatch(uint32_t rays, uint32_t patch, uint64_t seed) {
  thread_local std::vector<uint32_t> order;
  if (order.size() < rays) order.resize(rays);
  std::iota(order.begin(), order.begin() + rays, 0u);
  if (patch == 0) return order.data();
  const RandomStream random(mix64(seed) + patch, 0x531);
  for (uint32_t i = rays; i-- > 1;) std::swap(order[i], order[random.below(i, i + 1)]);
  return order.data();
}

// A buffer that is reused between calls.
float* partialGradients(size_t count) {
  thread_local std::vector<float> partial;
  if (partial.size() < count) partial.resize(count);
  return partial.data();
}

// Returns Σ (1 - SSIM) over a patch, and overwrites `gradients` with the gradients of Σ SSIM, [rays][3].
double differencesOfPatch(const S3imLoss& a, uint32_t rays, const uint32_t* order, float* gradients) {
  const float* predicted = hostPointer(a.predicted);
  const float* target = hostPointer(a.target);
  const float* weights = hostPointer(a.weights);
  const GroupWeights groupWeights;
  double sum = 0;
  const uint32_t used = rays / kGroup * kGroup;
  for (uint32_t first = 0; first < used; first += kGroup) {
    float x[3][kGroup], y[3][kGroup], g[3][kGroup];
    bool counts[kGroup];
    for (int p = 0; p < kGroup; ++p) {
      const size_t at = size_t{3} * order[first + p];
      counts[p] = !weights || weights[order[first + p]] != 0;
      for (int c = 0; c < 3; ++c) {
        x[c][p] = predicted[at + c];
        y[c][p] = counts[p] ? target[at + c] : predicted[at + c];
      }
    }
    for (int c = 0; c < 3; ++c) sum += 1 - static_cast<double>(similarity(x[c], y[c], groupWeights, g[c]));
    for (int p = 0; p < kGroup; ++p) {
      for (int c = 0; c < 3; ++c) gradients[size_t{3} * order[first + p] + c] = counts[p] ? g[c][p] : 0;
    }
  }
  for (uint32_t i = used; i < rays; ++i) std::fill_n(gradients + size_t{3} * order[i], 3, 0.0f);
  return sum;
}

}  // namespace

void run(Context& context, const ColourLoss& a) {
  const float* predicted = hostPointer(a.predicted);
  const float* target = hostPointer(a.target);
  const float* weights = hostPointer(a.weights);
  float* gradients = hostPointer(a.gradients);
  const size_t rays = hostCount(a.rays), tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  std::vector<double> sums(2 * tasks);
  context.pool.run(tasks, [&](size_t task, int) {
    double loss = 0, squares = 0;
    for (size_t ray = task * kRaysPerTask; ray < std::min(rays, (task + 1) * kRaysPerTask); ++ray) {
      const float weight = weights ? weights[ray] : 1;
      for (size_t i = 3 * ray; i < 3 * ray + 3; ++i) {
        const float r = predicted[i] - target[i];
        const ValueAndSlope f = robust(a.kind, a.parameter, r);
        loss += static_cast<double>(weight) * f.value;
        squares += static_cast<double>(weight) * r * r;
        gradients[i] = a.scale * weight * f.slope;
      }
    }
    sums[2 * task] = loss;
    sums[2 * task + 1] = squares;
  });
  double loss = 0, squares = 0;
  for (size_t task = 0; task < tasks; ++task) {
    loss += sums[2 * task];
    squares += sums[2 * task + 1];
  }
  float* out = hostPointer(a.loss);
  out[0] = static_cast<float>(a.scale * loss);
  out[1] = static_cast<float>(squares);
}

void run(Context& context, const DistortionLoss& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* weights = hostPointer(a.weights);
  const float* distances = hostPointer(a.distances);
  const float* steps = hostPointer(a.steps);
  float* gradients = hostPointer(a.weightGradients);
  const double loss = sumInOrder(context.pool, hostCount(a.rays), [&](size_t ray) {
    const uint32_t first = firstSample[ray], last = firstSample[ray + 1];
    double totalW = 0, totalWm = 0;
    const auto interval = [&](uint32_t i, double* middle, double* width) {
      const float begin = distances[i] - steps[i] / 2, end = distances[i] + steps[i] / 2;
      const double s0 = a.normalised ? begin : warped(begin), s1 = a.normalised ? end : warped(end);
      *middle = (s0 + s1) / 2;
      *width = s1 - s0;
    };
    double m, width;
    for (uint32_t i = first; i < last; ++i) {
      interval(i, &m, &width);
      totalW += weights[i];
      totalWm += weights[i] * m;
    }
    double beforeW = 0, beforeWm = 0, sum = 0;
    for (uint32_t i = first; i < last; ++i) {
      interval(i, &m, &width);
      const double w = weights[i];
      sum += 2 * w * (m * beforeW - beforeWm) + w * w * width / 3;
      const double afterW = totalW - beforeW - w, afterWm = totalWm - beforeWm - w * m;
      gradients[i] =
          static_cast<float>(a.scale * (2 * (m * (beforeW - afterW) + afterWm - beforeWm) + 2.0 / 3 * w * width));
      beforeW += w;
      beforeWm += w * m;
    }
    return sum;
  });
  *hostPointer(a.loss) = static_cast<float>(a.scale * loss);
}

void run(Context& context, const DepthLoss& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* weights = hostPointer(a.weights);
  const float* distances = hostPointer(a.distances);
  const float* known = hostPointer(a.known);
  float* gradients = hostPointer(a.weightGradients);
  const double loss = sumInOrder(context.pool, hostCount(a.rays), [&](size_t ray) {
    if (known[ray] <= 0) return 0.0;
    double sum = 1;
    for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1]; ++i) {
      const float off = std::abs(distances[i] - known[ray]) / known[ray] - a.tolerance;
      const float gain = 1 - std::clamp(off, 0.0f, 1.0f);
      sum -= weights[i] * gain;
      gradients[i] -= a.scale * gain;
    }
    return sum;
  });
  *hostPointer(a.loss) = static_cast<float>(a.scale * loss);
}

void run(Context& context, const S3imLoss& a) {
  const uint32_t rays = hostCount(a.rays), groups = rays / kGroup;
  float* loss = hostPointer(a.loss);
  *loss = 0;
  if (groups == 0 || a.patches == 0) return;
  const size_t numbers = size_t{3} * rays;
  float* partial = partialGradients(numbers * a.patches);
  std::vector<double> sums(a.patches);
  context.pool.run(a.patches, [&](size_t patch, int) {
    const uint32_t* order = orderOfPatch(rays, static_cast<uint32_t>(patch), a.seed);
    sums[patch] = differencesOfPatch(a, rays, order, partial + patch * numbers);
  });
  const double share = a.scale / (3.0 * groups * a.patches);
  *loss = static_cast<float>(share * std::accumulate(sums.begin(), sums.end(), 0.0));
  float* gradients = hostPointer(a.gradients);
  context.pool.forRanges(numbers, 3 * kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t patch = 1; patch < a.patches; ++patch) {
      for (size_t i = begin; i < end; ++i) partial[i] += partial[patch * numbers + i];
    }
    for (size_t i = begin; i < end; ++i) gradients[i] -= static_cast<float>(share) * partial[i];
  });
}

void run(Context& context, const OpacityLoss& a) {
  const float* opacities = hostPointer(a.opacities);
  float* gradients = hostPointer(a.opacityGradients);
  const double loss = sumInOrder(context.pool, hostCount(a.segments), [&](size_t i) {
    // Between 1/2 and 1 the difference from 1 is exact, so that clamping it is the same as clamping the opacity.
    const float full = std::clamp(opacities[i], 1e-5f, 1 - 1e-5f),
                clear = std::clamp(1 - opacities[i], 1e-5f, 1 - 1e-5f);
    const float logFull = std::log(full), logClear = std::log(clear);
    gradients[i] += a.scale * (logClear - logFull);
    return -(static_cast<double>(full) * logFull + static_cast<double>(clear) * logClear);
  });
  *hostPointer(a.loss) = static_cast<float>(a.scale * loss);
}

void run(Context& context, const SparsityLoss& a) {
  const float* logDensities = hostPointer(a.logDensities);
  const float* steps = hostPointer(a.runtimeSteps);
  float* gradients = hostPointer(a.gradients);
  const double loss = sumInOrder(context.pool, hostCount(a.points), [&](size_t i) {
    const float alpha = -std::expm1(-std::exp(logDensities[i]) * steps[i]);
    gradients[i] = a.scale * (1 - alpha) * steps[i] * std::exp(std::clamp(logDensities[i], -15.0f, 15.0f));
    return static_cast<double>(alpha);
  });
  *hostPointer(a.loss) = static_cast<float>(a.scale * loss);
}

void run(Context& context, const DitherLoss& a) {
  CHECK(a.colours.columns == 3u);
  CHECK(a.colourGradients.columns == 3u);
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* rayWeights = hostPointer(a.rayWeights);
  const float* weights = hostPointer(a.weights);
  const float* colours = hostPointer(a.colours.data);
  const float* colour = hostPointer(a.colour);
  const float* background = hostPointer(a.background);
  float* weightGradients = hostPointer(a.weightGradients);
  float* colourGradients = hostPointer(a.colourGradients.data);
  float* rayColourGradients = hostPointer(a.rayColourGradients);
  const double loss = sumInOrder(context.pool, hostCount(a.rays), [&](size_t ray) {
    const float rayWeight = rayWeights ? rayWeights[ray] : 1, scale = a.scale * rayWeight;
    double sum = 0;
    for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1]; ++i) {
      float square = 0;
      for (uint32_t c = 0; c < 3; ++c) {
        const float value = colours[a.colours.offset(i, c)];
        square += value * value;
        colourGradients[a.colourGradients.offset(i, c)] += 2 * scale * weights[i] * value;
      }
      sum += static_cast<double>(weights[i]) * square;
      weightGradients[i] = scale * square;
    }
    float squareBehind = 0;
    for (size_t i = 3 * ray; i < 3 * ray + 3; ++i) {
      sum -= static_cast<double>(colour[i]) * colour[i];
      rayColourGradients[i] -= 2 * scale * colour[i];
      if (background) squareBehind += background[i] * background[i];
    }
    if (background) {
      sum += (1 - static_cast<double>(hostPointer(a.opacity)[ray])) * squareBehind;
      hostPointer(a.rayOpacityGradients)[ray] -= scale * squareBehind;
    }
    return rayWeight * sum;
  });
  *hostPointer(a.loss) = static_cast<float>(a.scale * loss);
}

}  // namespace tessera::cpu
