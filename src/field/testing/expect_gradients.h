// For tests: compares the gradients of a parameter group with finite differences of a loss.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "field/parameters.h"

namespace tessera {

// Compares the six largest gradients; smaller ones are lost in the rounding of floats. The group's gradients must have
// been computed; `loss` is a function of the group's values, which are restored afterwards.
inline void expectGradientsOfDifferences(Device& device, ParameterGroup& group, const std::function<double()>& loss,
                                         float h = 2e-3f, double tolerance = 0.03) {
  const std::vector<float> gradients = device.read(group.gradients.all());
  std::vector<float> values = device.read(group.values.all());
  std::vector<size_t> order(gradients.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  const size_t count = std::min<size_t>(6, order.size());
  std::partial_sort(order.begin(), order.begin() + static_cast<ptrdiff_t>(count), order.end(),
                    [&](size_t a, size_t b) { return std::abs(gradients[a]) > std::abs(gradients[b]); });
  const double largest = std::abs(gradients[order[0]]);
  ASSERT_GT(largest, 1e-3) << group.name;
  for (size_t k = 0; k < count; ++k) {
    const float before = values[order[k]];
    const auto lossAt = [&](float value) {
      values[order[k]] = value;
      device.write(group.values.all(), std::span<const float>(values));
      return loss();
    };
    const double slope = (lossAt(before + h) - lossAt(before - h)) / (2.0 * h);
    lossAt(before);
    EXPECT_NEAR(gradients[order[k]], slope, tolerance * largest) << group.name << ", parameter " << order[k];
  }
}

}  // namespace tessera
