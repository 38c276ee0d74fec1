// Definitions of the templates declared in draw_scene.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/check.h"
#include "raymarch/cpu/draw_scene.h"

namespace tessera {
namespace draw_scene {

inline constexpr int kTile = 16;  // pixels along an edge of a task: neighbouring rays read the same texels

// Returns the pixel of a tile with this number. Numbers are ordered such that each packet of rays is a square of
// pixels.
inline std::pair<int, int> pixelOfTile(int number, int left, int top) {
  constexpr int kEdge = 4;
  static_assert(kEdge * kEdge == kRayLanes);
  const int square = number / (kEdge * kEdge), within = number % (kEdge * kEdge), across = kTile / kEdge;
  return {left + square % across * kEdge + within % kEdge, top + square / across * kEdge + within / kEdge};
}

template <class Content>
std::vector<const Content*> collectContents(const SceneDrawing<Content>& drawing) {
  std::vector<const Content*> contents;
  for (const DrawnContent<Content>& drawn : drawing.frontToBack) contents.push_back(drawn.content);
  if (drawing.backgroundBlock != nullptr) contents.push_back(drawing.backgroundBlock);
  if (drawing.backgroundContent != nullptr) contents.push_back(drawing.backgroundContent);
  // A content may be drawn in the cells of several tiles but has one number. Duplicates are removed such that the last
  // content stays last, because it gives the colour of rays that meet nothing.
  std::vector<const Content*> once;
  for (auto content = contents.rbegin(); content != contents.rend(); ++content) {
    if (std::find(once.begin(), once.end(), *content) == once.end()) once.insert(once.begin(), *content);
  }
  return once;
}

}  // namespace draw_scene

template <class Content>
RayCaster<Content>::RayCaster(const SceneDrawing<Content>& drawing)
    : drawing_(drawing), shading_(draw_scene::collectContents(drawing), drawing.march) {
  const std::vector<const Content*> numbered = draw_scene::collectContents(drawing);
  const auto place = [&numbered](const Content& content) {
    const auto number = std::find(numbered.begin(), numbered.end(), &content) - numbered.begin();
    Placed placed{&content, static_cast<size_t>(number), Vec3d::Constant(INFINITY), Vec3d::Constant(-INFINITY)};
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
  if (drawing.backgroundBlock != nullptr) {
    CHECK(drawing.backgroundBlock->parts.size() == 1u);
    backgroundBlock_.push_back(place(*drawing.backgroundBlock));
  }
}

template <class Content>
void RayCaster<Content>::add(const Placed& placed, size_t lanes, MarchCounts& counts) {
  std::array<PartRay, kRayLanes> rays;
  for (size_t i = 0; i < lanes; ++i) lanes_[i].composite = {};
  // Marches each ray through its parts in order; rays whose next part is the same are marched together.
  for (size_t turn = 0;; ++turn) {
    std::array<const Part*, kRayLanes> next = {};
    bool any = false;
    for (size_t i = 0; i < lanes; ++i) {
      const Lane& lane = lanes_[i];
      const bool seen = lane.composite.transmittance * shading_.transmittance(i) >= drawing_.march.minTransmittance;
      if (turn < lane.parts.size() && seen) next[i] = lane.parts[turn].part;
      any |= next[i] != nullptr;
    }
    if (!any) break;
    for (size_t i = 0; i < lanes; ++i) {
      const Part* part = next[i];
      if (part == nullptr) continue;
      size_t count = 0;
      for (size_t j = i; j < lanes; ++j) {
        if (next[j] != part) continue;
        next[j] = nullptr;
        rays[count++] = {j, lanes_[j].ray, lanes_[j].parts[turn].range, &lanes_[j].composite};
      }
      shading_.march(*placed.content, *part, std::span(rays).first(count), counts);
    }
  }
  for (size_t i = 0; i < lanes; ++i) {
    if (!lanes_[i].parts.empty()) shading_.add(i, lanes_[i].composite, placed.number);
  }
}

template <class Content>
void RayCaster<Content>::castPacket(std::span<const BoundedRay> rays, MarchCounts& counts) {
  const TileFrame& frame = drawing_.frame;
  for (size_t i = 0; i < rays.size(); ++i) {
    Lane& lane = lanes_[i];
    lane.ray = &rays[i].ray;
    shading_.begin(i, rays[i]);
    // Nothing is visible in front of the box.
    const RayRange box = clipToBox(*lane.ray, frame.low, frame.high, {frame.near, INFINITY});
    lane.whole = {box.empty() ? frame.near : box.near, std::min(rays[i].far, TileFrame::kSceneEnd)};
    lane.behind = {box.empty() ? frame.near : box.far, lane.whole.far};
  }
  for (const Placed& placed : placed_) {
    bool any = false;
    for (size_t i = 0; i < rays.size(); ++i) {
      Lane& lane = lanes_[i];
      lane.parts.clear();
      if (lane.whole.empty() || !seesOn(i)) continue;
      const RayRange range = clipToBox(*lane.ray, placed.low, placed.high, lane.whole);
      if (range.empty()) continue;
      for (const Part& part : placed.content->parts) {
        const RayRange owned = ownedRange(part, *lane.ray, range);
        if (!owned.empty()) lane.parts.push_back({&part, owned});
      }
      // Parts are convex and disjoint, so the order of entry is front to back.
      std::sort(lane.parts.begin(), lane.parts.end(),
                [](const PartRange& a, const PartRange& b) { return a.range.near < b.range.near; });
      any |= !lane.parts.empty();
    }
    if (any) add(placed, rays.size(), counts);
  }
  for (const Placed& placed : backgroundBlock_) {
    for (size_t i = 0; i < rays.size(); ++i) {
      Lane& lane = lanes_[i];
      lane.parts.clear();
      if (lane.whole.empty() || lane.behind.empty() || !seesOn(i)) continue;
      lane.parts.push_back({&placed.content->parts[0], lane.behind});
    }
    add(placed, rays.size(), counts);
  }
}

template <class Content>
void RayCaster<Content>::cast(std::span<const BoundedRay> rays, std::span<DrawnPixel> pixels, MarchCounts& counts) {
  CHECK(rays.size() == pixels.size());
  for (size_t first = 0; first < rays.size(); first += kRayLanes) {
    const size_t count = std::min(kRayLanes, rays.size() - first);
    castPacket(rays.subspan(first, count), counts);
    for (size_t i = 0; i < count; ++i) shading_.end(i, pixels[first + i]);
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

template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const Camera& camera, const Pose& worldFromCamera,
                       const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts) {
  return drawScene(drawing, PixelDirections(camera, pool), worldFromCamera, opaqueDepth, pool, counts);
}

template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const PixelDirections& directions,
                       const Pose& worldFromCamera, const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts) {
  using draw_scene::kTile;
  const Camera& camera = directions.camera();
  const TileFrame& frame = drawing.frame;
  RenderedView view = makeEmptyView(camera);
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
    for (int number = 0; number < kTile * kTile; ++number) {
      const auto [x, y] = draw_scene::pixelOfTile(number, left, top);
      if (x < camera.width && y < camera.height) {
        const Vec3d inCamera = directions.at(x, y).cast<double>();
        if (inCamera.isZero()) continue;  // the lens model has no direction for this pixel: it stays empty
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

}  // namespace tessera
