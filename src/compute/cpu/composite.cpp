#include "compute/composite.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 64;
constexpr int kMaxColumns = 16;

float computeOpacity(Extinction extinction, float x, float step) {
  switch (extinction) {
    case Extinction::opacity:
      return x;
    case Extinction::density:
      return -std::expm1(-x * step);
    case Extinction::logDensity:
      return -std::expm1(-std::exp(x) * step);
    case Extinction::logit:
      return 1 / (1 + std::exp(-x));
  }
  return 0;
}

template <int kColumns>
struct Columns {
  static constexpr int value = kColumns;
};

// Calls call(Columns<columns>()) if there is a specialised kernel for this number, otherwise call(Columns<-1>()).
template <class Call>
void withColumns(uint32_t columns, const Call& call) {
  CHECK(columns <= static_cast<uint32_t>(kMaxColumns));
  switch (columns) {
    case 0:
      return call(Columns<0>());
    case 3:
      return call(Columns<3>());
    case 7:
      return call(Columns<7>());
    case 8:
      return call(Columns<8>());
    default:
      return call(Columns<-1>());
  }
}

template <int kColumns>
void forward(Context& context, const CompositeForward& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* x = hostPointer(a.x.data);
  const float* steps = hostPointer(a.steps);
  const float* distances = hostPointer(a.distances);
  const float* colours = hostPointer(a.colours.data);
  const float* background = hostPointer(a.background);
  float* colour = hostPointer(a.colour);
  float* opacity = hostPointer(a.opacity);
  float* depth = hostPointer(a.depth);
  float* weights = hostPointer(a.weights);
  const int columns = kColumns < 0 ? static_cast<int>(a.colours.columns) : kColumns;
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      float transmittance = 1, sum[kColumns > 0 ? kColumns : kMaxColumns] = {}, far = 0;
      const uint32_t last = firstSample[ray + 1];
      uint32_t i = firstSample[ray];
      for (; i < last; ++i) {
        const float alpha = computeOpacity(a.extinction, x[a.x.offset(i, 0)] + a.offset, steps ? steps[i] : 0);
        const float weight = transmittance * alpha;
        if constexpr (kColumns != 0) {
          const float* c = colours + a.colours.offset(i, 0);
          for (int k = 0; k < columns; ++k) sum[k] += weight * c[k];
        }
        if (depth) far += weight * distances[i];
        weights[i] = weight;
        transmittance *= 1 - alpha;
        if (transmittance < a.minTransmittance) {
          ++i;
          break;
        }
      }
      for (; i < last; ++i) weights[i] = 0;
      for (int k = 0; k < columns; ++k) {
        colour[columns * ray + k] = sum[k] + (background ? transmittance * background[columns * ray + k] : 0);
      }
      opacity[ray] = 1 - transmittance;
      if (depth) depth[ray] = far;
    }
  });
}

// A buffer of one number per sample of a ray; each thread reuses its own.
template <int kWhich>
float* numbersOfRay(size_t samples) {
  thread_local std::vector<float> capacity;
  if (capacity.size() < samples) capacity.resize(samples + samples / 2);
  return capacity.data();
}

template <int kColumns>
void backward(Context& context, const CompositeBackward& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* x = hostPointer(a.x.data);
  const float* steps = hostPointer(a.steps);
  const float* distances = hostPointer(a.distances);
  const float* colours = hostPointer(a.colours.data);
  const float* background = hostPointer(a.background);
  const float* colourOfRay = hostPointer(a.rayColourGradients);
  const float* opacityOfRay = hostPointer(a.rayOpacityGradients);
  const float* depthOfRay = hostPointer(a.rayDepthGradients);
  const float* weightGradients = hostPointer(a.weightGradients);
  float* xGradients = hostPointer(a.xGradients);
  float* colourGradients = hostPointer(a.colourGradients.data);
  const int columns = kColumns < 0 ? static_cast<int>(a.colours.columns) : kColumns;
  const float fullDistance = a.fullGradientDistance;
  const bool add = a.addToXGradients;
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      const uint32_t first = firstSample[ray], last = firstSample[ray + 1];
      // Repeats the forward pass: opacities, and the transmittance in front of each sample. They are stored where the
      // gradients will be written, if that memory is free.
      float* alphas = add ? numbersOfRay<0>(last - first) : xGradients + first;
      float* transmittances = kColumns == 0 ? numbersOfRay<1>(last - first) : nullptr;
      const auto before = [&](uint32_t i) -> float& {
        return kColumns == 0 ? transmittances[i - first] : colourGradients[a.colourGradients.offset(i, 0)];
      };
      uint32_t stop = first;
      float transmittance = 1;
      while (stop < last) {
        const float alpha = computeOpacity(a.extinction, x[a.x.offset(stop, 0)] + a.offset, steps ? steps[stop] : 0);
        alphas[stop - first] = alpha;
        before(stop) = transmittance;
        transmittance *= 1 - alpha;
        ++stop;
        if (transmittance < a.minTransmittance) break;
      }
      const float* g = colourOfRay + columns * ray;
      // R: the derivative of the loss with respect to the light arriving from behind; opacity = 1 - T.
      float rear = opacityOfRay ? -opacityOfRay[ray] : 0;
      if (background) {
        for (int k = 0; k < columns; ++k) rear += g[k] * background[columns * ray + k];
      }
      for (uint32_t i = stop; i-- > first;) {
        const float alpha = alphas[i - first], reaching = before(i);
        float value = weightGradients ? weightGradients[i] : 0;
        if (depthOfRay) value += depthOfRay[ray] * distances[i];
        if constexpr (kColumns != 0) {
          const float weight = reaching * alpha;
          const float* c = colours + a.colours.offset(i, 0);
          float* dc = colourGradients + a.colourGradients.offset(i, 0);
          for (int k = 0; k < columns; ++k) {
            value += g[k] * c[k];
            dc[k] = weight * g[k];
          }
        }
        float slope = reaching * (value - rear);  // ∂L/∂α
        rear = alpha * value + (1 - alpha) * rear;
        if (a.extinction == Extinction::density) {
          slope = slope * (1 - alpha) * steps[i];
        } else if (a.extinction == Extinction::logDensity) {
          slope = slope * (1 - alpha) * steps[i] * std::exp(std::clamp(x[a.x.offset(i, 0)] + a.offset, -15.0f, 15.0f));
        } else if (a.extinction == Extinction::logit) {
          slope = slope * alpha * (1 - alpha);
        }
        if (fullDistance > 0 && distances[i] < fullDistance) {
          const float nearness = distances[i] / fullDistance, scale = nearness * nearness;
          slope *= scale;
          if constexpr (kColumns != 0) {
            float* dc = colourGradients + a.colourGradients.offset(i, 0);
            for (int k = 0; k < columns; ++k) dc[k] *= scale;
          }
        }
        xGradients[i] = add ? xGradients[i] + slope : slope;
      }
      for (uint32_t i = stop; i < last; ++i) {
        if (!add) xGradients[i] = 0;
        if constexpr (kColumns != 0) std::fill_n(colourGradients + a.colourGradients.offset(i, 0), columns, 0.0f);
      }
    }
  });
}

// Calls visit(sample, α, transmittance in front of it) for the samples of a ray that count, front to back. Returns the
// opacity of the ray.
template <class Arguments, class Visit>
float forOpaqueSamples(const Arguments& a, const float* x, size_t ray, const Visit& visit) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  float transmittance = 1;
  for (uint32_t i = firstSample[ray]; i < firstSample[ray + 1] && 1 - transmittance <= a.maxOpacity; ++i) {
    const float alpha = computeOpacity(Extinction::logit, x[a.x.offset(i, 0)] + a.offset, 0);
    if (!(alpha > a.threshold)) continue;
    visit(i, alpha, transmittance);
    transmittance *= 1 - alpha;
  }
  return 1 - transmittance;
}

}  // namespace

void run(Context& context, const OpaqueForward& a) {
  const float* x = hostPointer(a.x.data);
  const float* colours = hostPointer(a.colours.data);
  float* colour = hostPointer(a.colour);
  float* opacity = hostPointer(a.opacity);
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      float sum[3] = {};
      const float opacityOfRay = forOpaqueSamples(a, x, ray, [&](uint32_t i, float alpha, float transmittance) {
        for (int c = 0; c < 3; ++c) sum[c] += transmittance * alpha * colours[a.colours.offset(i, c)];
      });
      const bool counts = opacityOfRay > 0 && opacityOfRay >= a.minOpacity;
      opacity[ray] = counts ? opacityOfRay : 0;
      for (int c = 0; c < 3; ++c) colour[3 * ray + c] = counts ? sum[c] / opacityOfRay : 0;
    }
  });
}

void run(Context& context, const OpaqueBackward& a) {
  const float* x = hostPointer(a.x.data);
  const float* colours = hostPointer(a.colours.data);
  const float* colourOfRay = hostPointer(a.colour);
  const float* gradientOfRay = hostPointer(a.rayColourGradients);
  float* xGradients = hostPointer(a.xGradients);
  float* colourGradients = hostPointer(a.colourGradients.data);
  struct Sample {
    uint32_t index;
    float alpha, transmittance;
  };
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    std::vector<Sample> samples;
    for (size_t ray = begin; ray < end; ++ray) {
      samples.clear();
      const float opacity = forOpaqueSamples(a, x, ray, [&](uint32_t i, float alpha, float transmittance) {
        samples.push_back({i, alpha, transmittance});
      });
      if (!(opacity > 0 && opacity >= a.minOpacity)) continue;
      float rear = 0;
      for (size_t k = samples.size(); k-- > 0;) {
        const auto [i, alpha, transmittance] = samples[k];
        float excess = 0;
        for (int c = 0; c < 3; ++c) {
          const float g = gradientOfRay[3 * ray + c] / opacity;
          excess += g * (colours[a.colours.offset(i, c)] - colourOfRay[3 * ray + c]);
          colourGradients[a.colourGradients.offset(i, c)] += transmittance * alpha * g;
        }
        xGradients[i] += transmittance * (excess - rear) * alpha * (1 - alpha);
        rear = alpha * excess + (1 - alpha) * rear;
      }
    }
  });
}

void run(Context& context, const CompositeForward& a) {
  withColumns(a.colours.columns, [&](auto columns) { forward<decltype(columns)::value>(context, a); });
}

void run(Context& context, const CompositeBackward& a) {
  withColumns(a.colours.columns, [&](auto columns) { backward<decltype(columns)::value>(context, a); });
}

}  // namespace tessera::cpu
