#include "compute/adam.h"

#include <algorithm>
#include <cmath>

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

void adamStep(const Adam& options, double gradient, AdamState& state) {
  if (options.skipZeroGradients && gradient == 0) return;
  const double beta1 = options.beta1, beta2 = options.beta2;
  const double g = gradient + options.l2 * state.parameter;
  state.firstMoment = beta1 * state.firstMoment + (1 - beta1) * g;
  state.secondMoment = beta2 * state.secondMoment + (1 - beta2) * g * g;
  state.count += 1;
  const double rate = options.rate * std::sqrt(1 - std::pow(beta2, state.count)) / (1 - std::pow(beta1, state.count));
  state.parameter -= rate * state.firstMoment / (std::sqrt(state.secondMoment) + options.epsilon);
  const double bound = options.bound;
  if (std::abs(state.parameter) > bound) state.parameter = std::copysign(bound, state.parameter);
}

void run(const Adam& a) {
  const size_t n = a.parameters.count;
  if (isAnyAbove(a.overflowCounters, a.capacity)) {
    std::fill_n(hostPointer(a.gradients), n, 0.0f);
    return;
  }
  if (a.rows && hostPointer(a.rows)[0] == hostPointer(a.rows)[1]) return;
  for (const size_t count : {a.gradients.count, a.firstMoments.count, a.secondMoments.count, a.counts.count})
    CHECK(count == n);
  for (size_t i = 0; i < n; ++i) {
    float& parameter = hostPointer(a.parameters)[i];
    float& gradient = hostPointer(a.gradients)[i];
    float& firstMoment = hostPointer(a.firstMoments)[i];
    float& secondMoment = hostPointer(a.secondMoments)[i];
    uint32_t& count = hostPointer(a.counts)[i];
    AdamState state{parameter, firstMoment, secondMoment, count};
    adamStep(a, gradient, state);
    parameter = static_cast<float>(state.parameter);
    firstMoment = static_cast<float>(state.firstMoment);
    secondMoment = static_cast<float>(state.secondMoment);
    count = state.count;
    gradient = 0;
  }
}

}  // namespace tessera::reference
