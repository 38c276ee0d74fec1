// Opacities for compositing and its gradients.
// Defines: computeOpacity(), kMaxColumns, kOpacity, kDensity, kLogDensity.

const uint kMaxColumns = 16;
const uint kOpacity = 0, kDensity = 1, kLogDensity = 2;

// Returns 1 - exp(-x), without loss of precision for small x.
float oneMinusExp(float x) {
  if (abs(x) > 0.03) return 1 - exp(-x);
  return x * (1 - x * (0.5 - x * (1.0 / 6 - x * (1.0 / 24))));
}

float computeOpacity(uint extinction, float x, float length) {
  if (extinction == kOpacity) return x;
  return oneMinusExp((extinction == kDensity ? x : exp(x)) * length);
}
