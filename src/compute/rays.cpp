#include "compute/rays.h"

#include <cmath>

namespace tessera {

double MarchSpace::stepIndex(double t) const {
  if (cone <= 0) return t / minStep;
  const double lambda = std::log1p(static_cast<double>(cone));
  const double ta = minStep / lambda, tb = maxStep / lambda;
  if (t <= ta) return t / minStep;
  const double na = 1 / lambda;
  if (t <= tb) return na + std::log(t / ta) / lambda;
  return na + std::log(tb / ta) / lambda + (t - tb) / maxStep;
}

double MarchSpace::distanceAt(double n) const {
  if (cone <= 0) return n * minStep;
  const double lambda = std::log1p(static_cast<double>(cone));
  const double ta = minStep / lambda, tb = maxStep / lambda;
  const double na = 1 / lambda;
  if (n <= na) return n * minStep;
  const double nb = na + std::log(tb / ta) / lambda;
  if (n <= nb) return ta * std::exp((n - na) * lambda);
  return tb + (n - nb) * maxStep;
}

}  // namespace tessera
