#include "render/cpu/draw_scene.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace tessera {
namespace {

constexpr int kTile = 16;  // pixels along an edge of what one task draws: neighbours read the same texels

template <class Content>
std::vector<const Content*> contentsOf(const SceneDrawing<Content>& drawing) {
  std::vector<const Content*> contents;
  for (const DrawnContent<Content>& drawn : drawing.frontToBack) contents.push_back(drawn.content);
  if (drawing.surround != nullptr) contents.push_back(drawing.surround);
  return contents;
}

}  // namespace

template <class Content>
RayCaster<Content>::RayCaster(const SceneDrawing<Content>& drawing)
    : drawing_(drawing), shading_(contentsOf(drawing), drawing.march) {
  size_t number = 0;
  const auto place = [&number](const Content& content) {
    Placed placed{&content, number++, Vec3d::Constant(INFINITY), Vec3d::Constant(-INFINITY)};
    for (const Part& part : content.parts) {
      for (int a = 0; a < 3; ++a) {
        placed.low[a] = std::min<double>(placed.low[a], part.low[a]);
        placed.high[a] = std::max<double>(placed.high[a], part.high[a]);
      }
    }
    return placed;
  };
  for (const DrawnContent<Content>& drawn : drawing.frontToBack) {
    Placed& placed = placed_.emplace_back(place(*drawn.content));
    placed.low = placed.low.cwiseMax(drawn.low);
    placed.high = placed.high.cwiseMin(drawn.high);
  }
  if (drawing.surround != nullptr) {
    CHECK(drawing.surround->parts.size() == 1u);
    surround_.push_back(place(*drawing.surround));
  }
}

template <class Content>
void RayCaster<Content>::add(const Placed& placed, const SceneRay& ray, MarchCounts& counts) {
  ContentComposite composite;
  for (const PartRange& part : parts_) {
    if (composite.transmittance * shading_.transmittance() < drawing_.march.minTransmittance) break;
    shading_.march(*placed.content, *part.part, ray, part.range, composite, counts);
  }
  shading_.add(composite, placed.number);
}

template <class Content>
void RayCaster<Content>::castOne(const BoundedRay& bounded, MarchCounts& counts) {
  const TileFrame& frame = drawing_.frame;
  const SceneRay& ray = bounded.ray;
  // Nothing is met in front of the box.
  const RayRange box = clipToBox(ray, frame.low, frame.high, {frame.near, INFINITY});
  const RayRange whole{box.empty() ? frame.near : box.near, std::min(bounded.far, TileFrame::kSceneEnd)};
  if (whole.empty()) return;
  for (const Placed& placed : placed_) {
    if (shading_.transmittance() < drawing_.march.minTransmittance) return;
    const RayRange range = clipToBox(ray, placed.low, placed.high, whole);
    if (range.empty()) continue;
    parts_.clear();
    for (const Part& part : placed.content->parts) {
      const RayRange owned = ownedRange(part, ray, range);
      if (!owned.empty()) parts_.push_back({&part, owned});
    }
    // Convex and apart: in the order in which the ray enters them.
    std::sort(parts_.begin(), parts_.end(),
              [](const PartRange& a, const PartRange& b) { return a.range.near < b.range.near; });
    if (!parts_.empty()) add(placed, ray, counts);
  }
  if (!surround_.empty() && shading_.transmittance() >= drawing_.march.minTransmittance) {
    const RayRange behind{box.empty() ? frame.near : box.far, whole.far};
    parts_.assign(1, {&surround_[0].content->parts[0], behind});
    if (!behind.empty()) add(surround_[0], ray, counts);
  }
}

template <class Content>
void RayCaster<Content>::cast(std::span<const BoundedRay> rays, std::span<DrawnPixel> pixels, MarchCounts& counts) {
  CHECK(rays.size() == pixels.size());
  for (size_t i = 0; i < rays.size(); ++i) {
    shading_.begin(rays[i].ray.direction);
    castOne(rays[i], counts);
    shading_.end(pixels[i]);
  }
  shading_.finish();
}

template <class Content>
DrawnPixel RayCaster<Content>::cast(const SceneRay& ray, double far, MarchCounts& counts) {
  DrawnPixel pixel;
  const BoundedRay bounded{ray, far};
  cast(std::span(&bounded, 1), std::span(&pixel, 1), counts);
  return pixel;
}

void PixelDirections::update(const Camera& camera, ThreadPool& pool) {
  if (!directions_.empty() && camera == camera_) return;
  camera_ = camera;
  directions_.assign(static_cast<size_t>(camera.width) * camera.height, Vec3f::Zero());
  pool.run(static_cast<size_t>(camera.height), [&](size_t y, int) {
    for (int x = 0; x < camera.width; ++x) {
      const auto direction = camera.directionInCamera(Vec2d(x + 0.5, static_cast<double>(y) + 0.5));
      if (direction) directions_[y * static_cast<size_t>(camera.width) + x] = direction->cast<float>();
    }
  });
}

template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const Camera& camera, const Pose& worldFromCamera,
                       const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts) {
  return drawScene(drawing, PixelDirections(camera, pool), worldFromCamera, opaqueDepth, pool, counts);
}

template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const PixelDirections& directions,
                       const Pose& worldFromCamera, const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts) {
  const Camera& camera = directions.camera();
  const TileFrame& frame = drawing.frame;
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  const Mat3d sceneFromCamera = frame.rotation.transpose() * worldFromCamera.rotation;
  const Vec3d origin = frame.inScene(worldFromCamera.translation);
  const int columns = (camera.width + kTile - 1) / kTile, rows = (camera.height + kTile - 1) / kTile;
  struct Pixel {
    int x, y;
    double cosine;
  };
  std::vector<RayCaster<Content>> casters(static_cast<size_t>(pool.threads()), RayCaster<Content>(drawing));
  std::vector<MarchCounts> countsOfThread(casters.size());
  pool.run(static_cast<size_t>(columns) * rows, [&](size_t task, int thread) {
    const int left = static_cast<int>(task) % columns * kTile, top = static_cast<int>(task) / columns * kTile;
    std::vector<Pixel> pixels;
    std::vector<BoundedRay> rays;
    for (int y = top; y < std::min(top + kTile, camera.height); ++y) {
      for (int x = left; x < std::min(left + kTile, camera.width); ++x) {
        const Vec3d inCamera = directions.at(x, y).cast<double>();
        if (inCamera.isZero()) continue;  // beyond the lens: nothing
        const double cosine = inCamera.z();
        double far = INFINITY;
        if (opaqueDepth != nullptr && cosine > 0) far = *opaqueDepth->at(x, y) / (cosine * frame.scale);
        pixels.push_back({x, y, cosine});
        rays.push_back({{origin, (sceneFromCamera * inCamera).normalized()}, far});
      }
    }
    std::vector<DrawnPixel> drawn(rays.size());
    MarchCounts count;
    casters[thread].cast(rays, drawn, count);
    for (size_t i = 0; i < pixels.size(); ++i) {
      const auto [x, y, cosine] = pixels[i];
      std::copy(drawn[i].colour.begin(), drawn[i].colour.end(), view.colour.at(x, y));
      *view.opacity.at(x, y) = 1 - drawn[i].transmittance;
      *view.depth.at(x, y) = static_cast<float>(drawn[i].depth * cosine * frame.scale);
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

template class RayCaster<VolumeContent>;
template class RayCaster<HashContent>;
template RenderedView drawScene(const SceneDrawing<VolumeContent>&, const PixelDirections&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);
template RenderedView drawScene(const SceneDrawing<VolumeContent>&, const Camera&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);
template RenderedView drawScene(const SceneDrawing<HashContent>&, const PixelDirections&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);
template RenderedView drawScene(const SceneDrawing<HashContent>&, const Camera&, const Pose&, const ImageF*,
                                ThreadPool&, MarchCounts*);

}  // namespace tessera
