#include "compute/encodings.h"

#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

Doubles sphericalHarmonics(int degree, const double d[3]) {
  const double x = d[0], y = d[1], z = d[2];
  Doubles values = {0.28209479177387814,
                    -0.48860251190291987 * y,
                    0.48860251190291987 * z,
                    -0.48860251190291987 * x,
                    1.0925484305920792 * x * y,
                    -1.0925484305920792 * y * z,
                    0.94617469575755997 * z * z - 0.31539156525251999,
                    -1.0925484305920792 * x * z,
                    0.54627421529603959 * (x * x - y * y),
                    0.59004358992664352 * y * (y * y - 3 * x * x),
                    2.8906114426405538 * x * y * z,
                    0.45704579946446572 * y * (1 - 5 * z * z),
                    0.37317633259011546 * z * (5 * z * z - 3),
                    0.45704579946446572 * x * (1 - 5 * z * z),
                    1.4453057213202769 * z * (x * x - y * y),
                    0.59004358992664352 * x * (3 * y * y - x * x)};
  values.resize(static_cast<size_t>(degree) * degree);
  return values;
}

Point sphericalHarmonicsBackward(int degree, const double d[3], View gradients) {
  const double x = d[0], y = d[1], z = d[2];
  constexpr double a = 0.48860251190291987, b = 1.0925484305920792, c = 0.94617469575755997, e = 0.54627421529603959,
                   f = 0.59004358992664352, h = 2.8906114426405538, p = 0.45704579946446572, q = 0.37317633259011546,
                   r = 1.4453057213202769;
  const double slopes[16][3] = {{0, 0, 0},
                                {0, -a, 0},
                                {0, 0, a},
                                {-a, 0, 0},
                                {b * y, b * x, 0},
                                {0, -b * z, -b * y},
                                {0, 0, 2 * c * z},
                                {-b * z, 0, -b * x},
                                {2 * e * x, -2 * e * y, 0},
                                {-6 * f * x * y, 3 * f * (y * y - x * x), 0},
                                {h * y * z, h * x * z, h * x * y},
                                {0, p * (1 - 5 * z * z), -10 * p * y * z},
                                {0, 0, q * (15 * z * z - 3)},
                                {p * (1 - 5 * z * z), 0, -10 * p * x * z},
                                {2 * r * x * z, -2 * r * y * z, r * (x * x - y * y)},
                                {3 * f * (y * y - x * x), 6 * f * x * y, 0}};
  Point sum{};
  for (int i = 0; i < degree * degree; ++i)
    for (int axis = 0; axis < 3; ++axis) sum[axis] += gradients[i] * slopes[i][axis];
  return sum;
}

Doubles frequencyEncoding(int dimensions, int frequencies, const double* input) {
  Doubles values(input, input + dimensions);
  for (int k = 0; k < frequencies; ++k)
    for (int d = 0; d < dimensions; ++d) values.push_back(std::sin(std::ldexp(input[d], k)));
  for (int k = 0; k < frequencies; ++k)
    for (int d = 0; d < dimensions; ++d) values.push_back(std::cos(std::ldexp(input[d], k)));
  return values;
}

Doubles frequencyEncodingBackward(int dimensions, int frequencies, const double* input, View gradients) {
  Doubles sum(gradients.begin(), gradients.begin() + dimensions);
  for (int k = 0; k < frequencies; ++k)
    for (int d = 0; d < dimensions; ++d) {
      const double angle = std::ldexp(input[d], k);
      const size_t sine = dimensions * (1 + k) + d, cosine = sine + static_cast<size_t>(dimensions) * frequencies;
      sum[d] += std::ldexp(gradients[sine] * std::cos(angle) - gradients[cosine] * std::sin(angle), k);
    }
  return sum;
}

void run(const SphericalHarmonicsForward& a) {
  const size_t samples = hostCount(a.samples);
  const Indices rayOfSample = indices(a.rayOfSample, samples);
  const Doubles directions = doubles(a.directions, a.directions.count);
  Doubles encoded;
  for (size_t s = 0; s < samples; ++s) {
    const Doubles row = sphericalHarmonics(a.degree, &directions[3 * (rayOfSample.empty() ? s : rayOfSample[s])]);
    encoded.insert(encoded.end(), row.begin(), row.end());
  }
  store(a.encoded, encoded);
}

void run(const SphericalHarmonicsBackward& a) {
  const size_t samples = hostCount(a.samples), columns = static_cast<size_t>(a.degree) * a.degree;
  const Indices rayOfSample = indices(a.rayOfSample, samples);
  const Doubles directions = doubles(a.directions, a.directions.count);
  const Doubles upstream = doubles(a.encodedGradients, samples);
  Doubles gradients;
  for (size_t s = 0; s < samples; ++s) {
    const Point row = sphericalHarmonicsBackward(a.degree, &directions[3 * (rayOfSample.empty() ? s : rayOfSample[s])],
                                                 View(upstream).subspan(s * columns, columns));
    gradients.insert(gradients.end(), row.begin(), row.end());
  }
  store(a.directionGradients, gradients);
}

void run(const FrequencyForward& a) {
  const size_t samples = hostCount(a.samples);
  const Doubles inputs = doubles(a.inputs, samples * a.dimensions);
  Doubles encoded;
  for (size_t s = 0; s < samples; ++s) {
    const Doubles row = frequencyEncoding(a.dimensions, a.frequencies, &inputs[s * a.dimensions]);
    encoded.insert(encoded.end(), row.begin(), row.end());
  }
  store(a.encoded, encoded);
}

void run(const FrequencyBackward& a) {
  const size_t samples = hostCount(a.samples);
  const Doubles inputs = doubles(a.inputs, samples * a.dimensions);
  const Doubles upstream = doubles(a.encodedGradients, samples);
  const size_t columns = a.dimensions * (1 + 2 * static_cast<size_t>(a.frequencies));
  Doubles gradients;
  for (size_t s = 0; s < samples; ++s) {
    const Doubles row = frequencyEncodingBackward(a.dimensions, a.frequencies, &inputs[s * a.dimensions],
                                                  View(upstream).subspan(s * columns, columns));
    gradients.insert(gradients.end(), row.begin(), row.end());
  }
  store(a.inputGradients, gradients);
}

}  // namespace tessera::reference
