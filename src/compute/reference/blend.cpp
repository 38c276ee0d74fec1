#include "compute/blend.h"

#include "compute/reference/convert.h"
#include "compute/reference/functions.h"

namespace tessera::reference {

BlendedRay blendRay(bool literal, const RaySegments& segments) {
  BlendedRay ray;
  double transmittance = 1;
  for (size_t k = 0; k < segments.opacities.size(); ++k) {
    const double alpha = segments.opacities[k], gate = literal ? 1 : alpha;
    for (size_t c = 0; c < 3; ++c)
      ray.colour[c] += transmittance * (segments.composited[7 * k + c] + gate * segments.specular[3 * k + c]);
    if (!segments.depths.empty()) ray.depth += transmittance * segments.depths[k];
    transmittance *= 1 - alpha;
  }
  ray.opacity = 1 - transmittance;
  return ray;
}

BlendGradients blendRayBackward(bool literal, const RaySegments& segments, const Point& colourGradient,
                                double opacityGradient) {
  const size_t n = segments.opacities.size();
  BlendGradients gradients{Doubles(7 * n), Doubles(3 * n), Doubles(n)};
  Doubles before;  // transmittance in front of each segment
  double transmittance = 1;
  for (double alpha : segments.opacities) {
    before.push_back(transmittance);
    transmittance *= 1 - alpha;
  }
  double rear = -opacityGradient;  // derivative of the loss with respect to the light arriving from behind segment k
  for (size_t k = n; k-- > 0;) {
    const double alpha = segments.opacities[k], gate = literal ? 1 : alpha;
    double worth = 0, specularWorth = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double g = colourGradient[c];
      worth += g * (segments.composited[7 * k + c] + gate * segments.specular[3 * k + c]);
      specularWorth += g * segments.specular[3 * k + c];
      gradients.composited[7 * k + c] = before[k] * g;
      gradients.specular[3 * k + c] = before[k] * gate * g;
    }
    gradients.opacities[k] = before[k] * ((literal ? 0 : specularWorth) - rear);
    rear = worth + (1 - alpha) * rear;
  }
  return gradients;
}

namespace {

// Owns the segments of all rays.
struct AllSegments {
  Indices firstSegment;
  Doubles composited, specular, opacities, depths;

  AllSegments(Indices first, const Slice<const float>& composites, const Slice<const float>& speculars,
              const Slice<const float>& alphas)
      : firstSegment(first),
        composited(doubles(composites, 7 * size_t{first.back()})),
        specular(doubles(speculars, 3 * size_t{first.back()})),
        opacities(doubles(alphas, first.back())) {}
  RaySegments ofRay(size_t ray) const {
    const size_t first = firstSegment[ray], count = firstSegment[ray + 1] - first;
    RaySegments segments;
    segments.composited = View(composited).subspan(7 * first, 7 * count);
    segments.specular = View(specular).subspan(3 * first, 3 * count);
    segments.opacities = View(opacities).subspan(first, count);
    if (!depths.empty()) segments.depths = View(depths).subspan(first, count);
    return segments;
  }
};

}  // namespace

void run(const BlendForward& a) {
  const size_t rays = hostCount(a.rays);
  AllSegments all(indices(a.firstSegment, rays + 1), a.composited, a.specular, a.opacities);
  all.depths = doubles(a.depths, all.firstSegment[rays]);
  Doubles colour, opacity, depth;
  for (size_t r = 0; r < rays; ++r) {
    const BlendedRay ray = blendRay(a.literal, all.ofRay(r));
    colour.insert(colour.end(), ray.colour.begin(), ray.colour.end());
    opacity.push_back(ray.opacity);
    depth.push_back(ray.depth);
  }
  store(a.colour, colour);
  store(a.opacity, opacity);
  store(a.depth, depth);
}

void run(const BlendBackward& a) {
  const size_t rays = hostCount(a.rays);
  const AllSegments all(indices(a.firstSegment, rays + 1), a.composited, a.specular, a.opacities);
  const Doubles colourGradients = doubles(a.rayColourGradients, 3 * rays);
  const Doubles opacityGradients = doubles(a.rayOpacityGradients, rays);
  Doubles composited, specular, opacities;
  for (size_t r = 0; r < rays; ++r) {
    const BlendGradients ray = blendRayBackward(
        a.literal, all.ofRay(r), {colourGradients[3 * r], colourGradients[3 * r + 1], colourGradients[3 * r + 2]},
        opacityGradients.empty() ? 0 : opacityGradients[r]);
    composited.insert(composited.end(), ray.composited.begin(), ray.composited.end());
    specular.insert(specular.end(), ray.specular.begin(), ray.specular.end());
    opacities.insert(opacities.end(), ray.opacities.begin(), ray.opacities.end());
  }
  store(a.compositedGradients, composited);
  store(a.specularGradients, specular);
  store(a.opacityGradients, opacities);
}

}  // namespace tessera::reference
