#include "render/cpu/draw_volume.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace tessera {
namespace {

constexpr int kTile = 16;  // pixels along an edge of what one task draws: neighbours read the same texels

}  // namespace

VolumeRayCaster::VolumeRayCaster(const VolumeDrawing& drawing) : drawing_(drawing) {
  const auto place = [](const VolumeContent& content) {
    Placed placed{&content, DeferredShader(content.network), Vec3d::Constant(INFINITY), Vec3d::Constant(-INFINITY)};
    for (const VolumePart& part : content.parts) {
      for (int a = 0; a < 3; ++a) {
        placed.low[a] = std::min<double>(placed.low[a], part.low[a]);
        placed.high[a] = std::max<double>(placed.high[a], part.high[a]);
      }
    }
    return placed;
  };
  for (const DrawnVolume& drawn : drawing.frontToBack) {
    Placed& placed = placed_.emplace_back(place(*drawn.content));
    placed.low = placed.low.cwiseMax(drawn.low);
    placed.high = placed.high.cwiseMin(drawn.high);
  }
  if (drawing.surround != nullptr) {
    CHECK(drawing.surround->parts.size() == 1u);
    surround_.push_back(place(*drawing.surround));
  }
}

ContentComposite VolumeRayCaster::march(const Placed& placed, const SceneRay& ray, const std::vector<PartRange>& parts,
                                        float transmittanceBefore, MarchCounts& counts) const {
  ContentComposite composite;
  for (const PartRange& part : parts) {
    if (composite.transmittance * transmittanceBefore < drawing_.march.minTransmittance) break;
    const VolumePath path = volumePath(*part.part, ray, part.range);
    VolumeMarch{*placed.content, *part.part, path, drawing_.march, transmittanceBefore}.run(composite, counts);
  }
  return composite;
}

BlendedRay VolumeRayCaster::cast(const SceneRay& ray, double far, MarchCounts& counts) {
  const VolumeFrame& frame = drawing_.frame;
  BlendedRay blended;
  // Nothing is met in front of the box.
  const RayRange box = clipToBox(ray, frame.low, frame.high, {frame.near, INFINITY});
  const RayRange whole{box.empty() ? frame.near : box.near, std::min(far, VolumeFrame::kSceneEnd)};
  if (whole.empty()) return blended;
  const std::array<float, 27> direction = encodeDirection(ray.direction);
  const auto add = [&](const Placed& placed) {
    const ContentComposite composite = march(placed, ray, parts_, blended.transmittance, counts);
    blended.add(composite, placed.shader, direction);
  };
  for (const Placed& placed : placed_) {
    if (blended.transmittance < drawing_.march.minTransmittance) return blended;
    const RayRange range = clipToBox(ray, placed.low, placed.high, whole);
    if (range.empty()) continue;
    parts_.clear();
    for (const VolumePart& part : placed.content->parts) {
      const RayRange owned = ownedRange(part, ray, range);
      if (!owned.empty()) parts_.push_back({&part, owned});
    }
    // Convex and apart: in the order in which the ray enters them.
    std::sort(parts_.begin(), parts_.end(),
              [](const PartRange& a, const PartRange& b) { return a.range.near < b.range.near; });
    if (!parts_.empty()) add(placed);
  }
  if (!surround_.empty() && blended.transmittance >= drawing_.march.minTransmittance) {
    const RayRange behind{box.empty() ? frame.near : box.far, whole.far};
    parts_.assign(1, {&surround_[0].content->parts[0], behind});
    if (!behind.empty()) add(surround_[0]);
  }
  return blended;
}

RenderedView drawVolume(const VolumeDrawing& drawing, const Camera& camera, const Pose& worldFromCamera,
                        const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts) {
  const VolumeFrame& frame = drawing.frame;
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  const Mat3d sceneFromCamera = frame.rotation.transpose() * worldFromCamera.rotation;
  const Vec3d origin = frame.inScene(worldFromCamera.translation);
  const int columns = (camera.width + kTile - 1) / kTile, rows = (camera.height + kTile - 1) / kTile;
  std::vector<VolumeRayCaster> casters(static_cast<size_t>(pool.threads()), VolumeRayCaster(drawing));
  std::vector<MarchCounts> countsOfThread(casters.size());
  pool.run(static_cast<size_t>(columns) * rows, [&](size_t task, int thread) {
    MarchCounts count;
    const int left = static_cast<int>(task) % columns * kTile, top = static_cast<int>(task) / columns * kTile;
    for (int y = top; y < std::min(top + kTile, camera.height); ++y) {
      for (int x = left; x < std::min(left + kTile, camera.width); ++x) {
        const std::optional<Vec3d> inCamera = camera.directionInCamera(Vec2d(x + 0.5, y + 0.5));
        if (!inCamera) continue;  // beyond the lens: nothing
        const double cosine = inCamera->z();
        double far = INFINITY;
        if (opaqueDepth != nullptr && cosine > 0) far = *opaqueDepth->at(x, y) / (cosine * frame.scale);
        const BlendedRay ray = casters[thread].cast({origin, (sceneFromCamera * *inCamera).normalized()}, far, count);
        std::copy(ray.colour.begin(), ray.colour.end(), view.colour.at(x, y));
        *view.opacity.at(x, y) = 1 - ray.transmittance;
        *view.depth.at(x, y) = static_cast<float>(ray.depth * cosine * frame.scale);
      }
    }
    countsOfThread[thread].steps += count.steps;
    countsOfThread[thread].samples += count.samples;
  });
  if (counts != nullptr) {
    for (const MarchCounts& count : countsOfThread) {
      counts->steps += count.steps;
      counts->samples += count.samples;
    }
  }
  return view;
}

}  // namespace tessera
