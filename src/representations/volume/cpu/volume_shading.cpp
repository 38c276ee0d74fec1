#include "representations/volume/cpu/volume_shading.h"

#include <algorithm>
#include <cmath>

namespace tessera {

std::array<float, 27> encodeDirection(const Vec3d& direction) {
  std::array<float, 27> encoded;
  for (int c = 0; c < 3; ++c) {
    encoded[c] = static_cast<float>(direction[c]);
    double sine = std::sin(direction[c]), cosine = std::cos(direction[c]);
    for (int k = 0; k < 4; ++k) {
      encoded[3 + 3 * k + c] = static_cast<float>(sine);
      encoded[15 + 3 * k + c] = static_cast<float>(cosine);
      const double twice = 2 * sine * cosine;
      cosine = 1 - 2 * sine * sine;
      sine = twice;
    }
  }
  return encoded;
}

std::array<float, 3> DeferredShader::shade(const ContentComposite& composite,
                                           const std::array<float, 27>& direction) const {
  alignas(64) float values[DenseNetwork::kMaxWidth];
  std::copy(composite.values, composite.values + ContentComposite::kValues, values);
  std::copy(direction.begin(), direction.end(), values + ContentComposite::kValues);
  network_.run(values);
  std::array<float, 3> colour;
  for (int c = 0; c < 3; ++c) colour[c] = 1 / (1 + std::exp(-values[c]));
  return colour;
}

void BlendedRay::add(const ContentComposite& composite, const DeferredShader& shader,
                     const std::array<float, 27>& direction) {
  const float opacity = 1 - composite.transmittance;
  if (opacity <= 0) return;
  const std::array<float, 3> specular = shader.shade(composite, direction);
  for (int c = 0; c < 3; ++c) colour[c] += transmittance * (composite.values[c] + opacity * specular[c]);
  depth += transmittance * composite.depth;
  transmittance *= composite.transmittance;
}

VolumeShading::VolumeShading(const std::vector<const VolumeContent*>& contents, const MarchSettings& settings)
    : settings_(settings) {
  for (const VolumeContent* content : contents) shaders_.emplace_back(content->network);
}

void VolumeShading::begin(size_t lane, const BoundedRay& ray) {
  lanes_[lane] = {{}, encodeDirection(ray.ray.direction)};
}

void VolumeShading::march(const VolumeContent& content, const VolumePart& part, std::span<const PartRay> rays,
                          MarchCounts& counts) const {
  for (const PartRay& ray : rays) {
    const VolumePath path = volumePath(part, *ray.ray, ray.range);
    VolumeMarch{content, part, path, settings_, transmittance(ray.lane)}.run(*ray.composite, counts);
  }
}

}  // namespace tessera
