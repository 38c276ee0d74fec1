#include "representations/hash/cpu/hash_shading.h"

#include <algorithm>
#include <cmath>

#include "scene/spherical_harmonics.h"

namespace tessera {

HashShading::HashShading(const std::vector<const HashContent*>& contents, const MarchSettings& settings)
    : settings_(settings) {
  std::vector<const std::vector<DenseLayer>*> known;
  for (const HashContent* content : contents) {
    const auto same = std::find_if(known.begin(), known.end(),
                                   [content](const auto* network) { return *network == content->network; });
    networkOfContent_.push_back(static_cast<size_t>(same - known.begin()));
    if (same == known.end()) {
      known.push_back(&content->network);
      networks_.emplace_back(content->network, kInputs, kOutputs);
    }
    hasLearnedBackground_ |= content->hasLearnedBackground;
    for (const HashPart& part : content->parts) features_.emplace(&part, HashFeatures(*content, part));
  }
}

void HashShading::begin(size_t number, const BoundedRay& ray) {
  Lane& lane = lanes_[number];
  lane.sums = {};
  lane.direction = ray.ray.direction;
  lane.isOpen = !std::isfinite(ray.far);
  lane.weights.clear();
}

void HashShading::march(const HashContent& content, const HashPart& part, std::span<const PartRay> rays,
                        MarchCounts& counts) {
  std::array<HashRay*, kRayLanes> all;
  for (size_t i = 0; i < rays.size(); ++i) {
    rays_[i].path = partPath(part, *rays[i].ray, rays[i].range);
    rays_[i].transmittanceBefore = transmittance(rays[i].lane);
    rays_[i].composite = *rays[i].composite;
    all[i] = &rays_[i];
  }
  HashMarch{features_.at(&part), content.step, settings_}.run(std::span(all).first(rays.size()), counts);
  for (size_t i = 0; i < rays.size(); ++i) *rays[i].composite = rays_[i].composite;
}

void HashShading::add(size_t number, const ContentComposite& composite, size_t content) {
  Lane& lane = lanes_[number];
  const float weight = lane.sums.transmittance * (1 - composite.transmittance);
  const size_t network = networkOfContent_[content];
  const auto known = std::find_if(lane.weights.begin(), lane.weights.end(),
                                  [network](const auto& one) { return one.first == network; });
  if (known != lane.weights.end()) {
    known->second += weight;
  } else if (weight > 0) {
    lane.weights.emplace_back(network, weight);
  }
  for (int k = 0; k < ContentComposite::kValues; ++k) {
    lane.sums.values[k] += lane.sums.transmittance * composite.values[k];
  }
  lane.sums.depth += lane.sums.transmittance * composite.depth;
  lane.sums.transmittance *= composite.transmittance;
}

void HashShading::end(size_t number, DrawnPixel& pixel) {
  const Lane& lane = lanes_[number];
  pixel = {{0, 0, 0}, lane.sums.transmittance, lane.sums.depth};
  const bool isOpaque = hasLearnedBackground_ && lane.isOpen;
  if (networks_.empty() || (!isOpaque && lane.sums.transmittance >= 1)) return;
  const auto heaviest = std::max_element(lane.weights.begin(), lane.weights.end(),
                                         [](const auto& a, const auto& b) { return a.second < b.second; });
  const size_t network = heaviest == lane.weights.end() ? networkOfContent_.back() : heaviest->first;
  pending_.push_back({&pixel, lane.sums, lane.direction, network, isOpaque});
}

void HashShading::finish() {
  constexpr size_t kPacket = DenseNetwork::kPacket;
  alignas(64) float values[DenseNetwork::kMaxWidth * kPacket];
  // Rays of the same network are placed next to each other.
  std::stable_sort(pending_.begin(), pending_.end(),
                   [](const PendingPixel& a, const PendingPixel& b) { return a.network < b.network; });
  for (size_t first = 0; first < pending_.size();) {
    const size_t network = pending_[first].network;
    size_t count = 0;
    for (; count < kPacket && first + count < pending_.size() && pending_[first + count].network == network; ++count) {
      const PendingPixel& ray = pending_[first + count];
      const std::array<float, 16> harmonics = evaluateHarmonics(ray.direction);
      for (size_t k = 0; k < ContentComposite::kValues; ++k) values[k * kPacket + count] = ray.sums.values[k];
      for (size_t k = 0; k < harmonics.size(); ++k) {
        values[(ContentComposite::kValues + k) * kPacket + count] = harmonics[k];
      }
    }
    for (size_t column = count; column < kPacket; ++column) {
      for (size_t k = 0; k < kInputs; ++k) values[k * kPacket + column] = 0;
    }
    networks_[network].runPacket(values);
    for (size_t column = 0; column < count; ++column) {
      const PendingPixel& ray = pending_[first + column];
      DrawnPixel& pixel = *ray.pixel;
      if (ray.isOpaque) {
        pixel.depth /= std::max(1 - pixel.transmittance, 1e-6f);  // the pixel is opaque
        pixel.transmittance = 0;
      }
      for (size_t c = 0; c < kOutputs; ++c) {
        const float z = ray.sums.values[c] + values[c * kPacket + column];
        pixel.colour[c] = (1 - pixel.transmittance) / (1 + std::exp(-z));
      }
    }
    first += count;
  }
  pending_.clear();
}

}  // namespace tessera
