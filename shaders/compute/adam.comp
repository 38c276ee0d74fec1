// One step of Adam; see src/compute/adam.h for the formula. One invocation per parameter.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_adam.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(AdamArguments)

// base^exponent by squaring: exact for small exponents, where 1 - β^k needs full precision, which pow() does not
// guarantee.
float power(float base, uint exponent) {
  float result = 1;
  for (; exponent != 0 && result != 0; exponent >>= 1) {
    if ((exponent & 1) != 0) result *= base;
    base *= base;
  }
  return result;
}

bool hasOverflow(AdamArguments a) {
  for (uint i = 0; i < a.overflowCounterCount; ++i) {
    if (a.overflowCounters.values[i] > a.capacity) return true;
  }
  return false;
}

void main() {
  AdamArguments a = arguments.values;
  if (hasOverflow(a)) {
    FOR_EACH(i, a.count) a.gradients.values[i] = 0;
    return;
  }
  if (a.rows.values[0] == a.rows.values[1]) return;
  FOR_EACH(i, a.count) {
    float gradient = a.gradients.values[i];
    if (gradient == 0 && a.skipZeroGradients != 0) continue;
    const float parameter = a.parameters.values[i];
    gradient += a.l2 * parameter;
    const float m = a.beta1 * a.firstMoments.values[i] + (1 - a.beta1) * gradient;
    const float v = a.beta2 * a.secondMoments.values[i] + (1 - a.beta2) * gradient * gradient;
    const uint k = a.counts.values[i] + 1;
    const float rate = a.rate * sqrt(1 - power(a.beta2, k)) / (1 - power(a.beta1, k));
    const float moved = parameter - rate * m / (sqrt(v) + a.epsilon);
    a.parameters.values[i] = abs(moved) > a.bound ? sign(moved) * a.bound : moved;
    a.firstMoments.values[i] = m;
    a.secondMoments.values[i] = v;
    a.counts.values[i] = k;
    a.gradients.values[i] = 0;
  }
}
