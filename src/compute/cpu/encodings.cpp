#include "compute/encodings.h"

#include <cmath>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kGrain = 4096;

void harmonics(int degree, float x, float y, float z, float* out) {
  out[0] = 0.28209479177f;
  if (degree < 2) return;
  out[1] = -0.48860251190f * y;
  out[2] = 0.48860251190f * z;
  out[3] = -0.48860251190f * x;
  if (degree < 3) return;
  const float xx = x * x, yy = y * y, zz = z * z;
  out[4] = 1.09254843059f * x * y;
  out[5] = -1.09254843059f * y * z;
  out[6] = 0.94617469576f * zz - 0.31539156525f;
  out[7] = -1.09254843059f * x * z;
  out[8] = 0.54627421529f * (xx - yy);
  if (degree < 4) return;
  out[9] = 0.59004358993f * y * (yy - 3 * xx);
  out[10] = 2.89061144264f * x * y * z;
  out[11] = 0.45704579946f * y * (1 - 5 * zz);
  out[12] = 0.37317633259f * z * (5 * zz - 3);
  out[13] = 0.45704579946f * x * (1 - 5 * zz);
  out[14] = 1.44530572132f * z * (xx - yy);
  out[15] = 0.59004358993f * x * (3 * yy - xx);
}

// gradient[axis] = Σ_i g[i] ∂Y_i/∂axis
void harmonicsGradient(int degree, float x, float y, float z, const float* g, float gradient[3]) {
  float dx = 0, dy = 0, dz = 0;
  if (degree >= 2) {
    dy += -0.48860251190f * g[1];
    dz += 0.48860251190f * g[2];
    dx += -0.48860251190f * g[3];
  }
  if (degree >= 3) {
    constexpr float a = 1.09254843059f, b = 0.54627421529f;
    dx += a * y * g[4] - a * z * g[7] + 2 * b * x * g[8];
    dy += a * x * g[4] - a * z * g[5] - 2 * b * y * g[8];
    dz += -a * y * g[5] + 2 * 0.94617469576f * z * g[6] - a * x * g[7];
  }
  if (degree >= 4) {
    constexpr float a = 0.59004358993f, b = 2.89061144264f, c = 0.45704579946f, e = 0.37317633259f, f = 1.44530572132f;
    const float xx = x * x, yy = y * y, zz = z * z;
    dx += -6 * a * x * y * g[9] + b * y * z * g[10] + c * (1 - 5 * zz) * g[13] + 2 * f * x * z * g[14] +
          a * (3 * yy - 3 * xx) * g[15];
    dy += a * (3 * yy - 3 * xx) * g[9] + b * x * z * g[10] + c * (1 - 5 * zz) * g[11] - 2 * f * y * z * g[14] +
          6 * a * x * y * g[15];
    dz += b * x * y * g[10] - 10 * c * y * z * g[11] + e * (15 * zz - 3) * g[12] - 10 * c * x * z * g[13] +
          f * (xx - yy) * g[14];
  }
  gradient[0] = dx;
  gradient[1] = dy;
  gradient[2] = dz;
}

}  // namespace

void run(Context& context, const SphericalHarmonicsForward& a) {
  CHECK(a.degree >= 1);
  CHECK(a.degree <= 4);
  const float* directions = hostPointer(a.directions);
  const uint32_t* rayOfSample = hostPointer(a.rayOfSample);
  float* encoded = hostPointer(a.encoded.data);
  context.pool.forRanges(hostCount(a.samples), kGrain, [&](size_t begin, size_t end) {
    size_t previous = ~size_t{0};
    const float* row = nullptr;
    for (size_t i = begin; i < end; ++i) {
      const size_t ray = rayOfSample ? rayOfSample[i] : i;
      float* to = encoded + i * a.encoded.rowStride;
      if (ray == previous) {  // samples of a ray are consecutive
        for (int k = 0; k < a.degree * a.degree; ++k) to[k] = row[k];
      } else {
        harmonics(a.degree, directions[3 * ray], directions[3 * ray + 1], directions[3 * ray + 2], to);
        previous = ray;
      }
      row = to;
    }
  });
}

void run(Context& context, const SphericalHarmonicsBackward& a) {
  CHECK(a.degree >= 1);
  CHECK(a.degree <= 4);
  const float* directions = hostPointer(a.directions);
  const uint32_t* rayOfSample = hostPointer(a.rayOfSample);
  const float* gradients = hostPointer(a.encodedGradients.data);
  float* out = hostPointer(a.directionGradients);
  context.pool.forRanges(hostCount(a.samples), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* d = directions + 3 * (rayOfSample ? rayOfSample[i] : i);
      harmonicsGradient(a.degree, d[0], d[1], d[2], gradients + i * a.encodedGradients.rowStride, out + 3 * i);
    }
  });
}

void run(Context& context, const FrequencyForward& a) {
  const float* inputs = hostPointer(a.inputs);
  float* encoded = hostPointer(a.encoded.data);
  const int n = a.dimensions;
  context.pool.forRanges(hostCount(a.samples), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float* to = encoded + i * a.encoded.rowStride;
      for (int c = 0; c < n; ++c) {
        const float x = inputs[i * n + c];
        to[c] = x;
        for (int k = 0; k < a.frequencies; ++k) {
          const float angle = std::ldexp(x, k);
          to[n + k * n + c] = std::sin(angle);
          to[n + (a.frequencies + k) * n + c] = std::cos(angle);
        }
      }
    }
  });
}

void run(Context& context, const FrequencyBackward& a) {
  const float* inputs = hostPointer(a.inputs);
  const float* gradients = hostPointer(a.encodedGradients.data);
  float* out = hostPointer(a.inputGradients);
  const int n = a.dimensions;
  context.pool.forRanges(hostCount(a.samples), kGrain, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const float* g = gradients + i * a.encodedGradients.rowStride;
      for (int c = 0; c < n; ++c) {
        float sum = g[c];
        for (int k = 0; k < a.frequencies; ++k) {
          const float angle = std::ldexp(inputs[i * n + c], k);
          sum +=
              std::ldexp(g[n + k * n + c] * std::cos(angle) - g[n + (a.frequencies + k) * n + c] * std::sin(angle), k);
        }
        out[i * n + c] = sum;
      }
    }
  });
}

}  // namespace tessera::cpu
