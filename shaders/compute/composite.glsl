// What compositing and its gradients share.
// Defines: opacityOf(), kMostColumns, kOpacity, kDensity, kLogDensity.

const uint kMostColumns = 16;
const uint kOpacity = 0, kDensity = 1, kLogDensity = 2;

// 1 - exp(-x) without loss where x is small.
float oneMinusExp(float x) {
  if (abs(x) > 0.03) return 1 - exp(-x);
  return x * (1 - x * (0.5 - x * (1.0 / 6 - x * (1.0 / 24))));
}

float opacityOf(uint extinction, float x, float length) {
  if (extinction == kOpacity) return x;
  return oneMinusExp((extinction == kDensity ? x : exp(x)) * length);
}
