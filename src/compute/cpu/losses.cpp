#include "compute/losses.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 256;  // fixed: partial sums are added in task order

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

// MERF's warp of distance (building blocks 7.1).
float warped(float t) {
  return t < 1 ? t / 2 : 1 - 1 / (2 * t);
}

// Σ lossOfRay(ray), added in one fixed order.
template <class LossOfRay>
double sumOverRays(ThreadPool& pool, size_t rays, const LossOfRay& lossOfRay) {
  const size_t tasks = (rays + kRaysPerTask - 1) / kRaysPerTask;
  std::vector<double> sums(tasks);
  pool.run(tasks, [&](size_t task, int) {
    for (size_t ray = task * kRaysPerTask; ray < std::min(rays, (task + 1) * kRaysPerTask); ++ray) {
      sums[task] += lossOfRay(ray);
    }
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
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
  const double loss = sumOverRays(context.pool, hostCount(a.rays), [&](size_t ray) {
    const uint32_t first = firstSample[ray], last = firstSample[ray + 1];
    double totalW = 0, totalWm = 0;
    const auto interval = [&](uint32_t i, double* middle, double* width) {
      const double s0 = warped(distances[i] - steps[i] / 2), s1 = warped(distances[i] + steps[i] / 2);
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
  const double loss = sumOverRays(context.pool, hostCount(a.rays), [&](size_t ray) {
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

void run(Context& context, const ExposureForward& a) {
  const float* colours = hostPointer(a.colours);
  const uint32_t* photoOfRay = hostPointer(a.photoOfRay);
  const float* logGains = hostPointer(a.logGains);
  const float* opacity = hostPointer(a.opacity);
  const float* background = hostPointer(a.background);
  float* exposed = hostPointer(a.exposed);
  context.pool.forRanges(hostCount(a.rays), 1024, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      for (int k = 0; k < 3; ++k) {
        float value = colours[3 * ray + k] * std::exp2(logGains[3 * photoOfRay[ray] + k]);
        if (background) value += (1 - opacity[ray]) * background[3 * ray + k];
        exposed[3 * ray + k] = value;
      }
    }
  });
}

void run(Context&, const ExposureBackward& a) {
  const float* colours = hostPointer(a.colours);
  const uint32_t* photoOfRay = hostPointer(a.photoOfRay);
  const float* logGains = hostPointer(a.logGains);
  const float* exposedGradients = hostPointer(a.exposedGradients);
  const float* background = hostPointer(a.background);
  float* colourGradients = hostPointer(a.colourGradients);
  float* opacityGradients = hostPointer(a.opacityGradients);
  float* logGainGradients = hostPointer(a.logGainGradients);
  constexpr float kLn2 = 0.69314718056f;
  const size_t rays = hostCount(a.rays);
  for (size_t ray = 0; ray < rays; ++ray) {  // thousands of rays: not worth a split, and in one fixed order
    float behind = 0;
    for (int k = 0; k < 3; ++k) {
      const size_t photo = 3 * photoOfRay[ray] + k;
      if (background) behind += exposedGradients[3 * ray + k] * background[3 * ray + k];
      const float gain = std::exp2(logGains[photo]), g = exposedGradients[3 * ray + k];
      logGainGradients[photo] += g * colours[3 * ray + k] * gain * kLn2;
      colourGradients[3 * ray + k] = g * gain;
    }
    if (background) opacityGradients[ray] = -behind;
  }
}

}  // namespace tessera::cpu
