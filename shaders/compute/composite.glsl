// Opacities for compositing and its gradients.
// Defines: computeOpacity(), usesSteps(), kMaxColumns, kOpacity, kDensity, kLogDensity, kLogit.

const uint kMaxColumns = 16;
const uint kOpacity = 0, kDensity = 1, kLogDensity = 2, kLogit = 3;

bool usesSteps(uint extinction) { return extinction == kDensity || extinction == kLogDensity; }

// Returns 1 - exp(-x), without loss of precision for small x.
float oneMinusExp(float x) {
  if (abs(x) > 0.03) return 1 - exp(-x);
  return x * (1 - x * (0.5 - x * (1.0 / 6 - x * (1.0 / 24))));
}

float computeOpacity(uint extinction, float x, float length) {
  if (extinction == kOpacity) return x;
  if (extinction == kLogit) return 1 / (1 + exp(-x));
  return oneMinusExp((extinction == kDensity ? x : exp(x)) * length);
}
