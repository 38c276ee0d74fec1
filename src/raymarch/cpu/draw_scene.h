// A picture of ray-marched contents in memory: the definition of what such scenes look like, on the CPU. The templates
// are defined in draw_scene-inl.h and instantiated once for each content, in the file that makes its drawer.
#pragma once

#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "base/threads.h"
#include "raymarch/cpu/shading.h"
#include "render/drawer.h"
#include "render/pixel_directions.h"
#include "render/tile_frame.h"
#include "scene/view_renderer.h"

namespace tessera {

// Content: one that has parts, and a Shading.
template <class Content>
struct SceneDrawing {
  TileFrame frame;
  // In an order that is front to back for every ray of the camera (render/tile_tree.h).
  std::vector<DrawnContent<Content>> frontToBack;
  // Optional: seen behind the frame's box, or alone by rays that miss it.
  const Content* surround = nullptr;
  MarchSettings march;
  // Optional: one that counts as the last of all in what shadings say of rays that meet nothing, though no ray meets
  // it. Without: the surround, or the last one.
  const Content* ofNothing = nullptr;
};

// As ViewRenderer::render. The picture does not depend on the number of threads. `counts`: optional, added to.
template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const PixelDirections& pixels, const Pose& worldFromCamera,
                       const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts = nullptr);
template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const Camera& camera, const Pose& worldFromCamera,
                       const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts = nullptr);

// Rays through a drawing, which must outlive this. Not for several threads at a time.
template <class Content>
class RayCaster {
 public:
  explicit RayCaster(const SceneDrawing<Content>& drawing);

  // pixels: [rays].
  void cast(std::span<const BoundedRay> rays, std::span<DrawnPixel> pixels, MarchCounts& counts);
  DrawnPixel cast(const SceneRay& ray, double far, MarchCounts& counts);

 private:
  using Part = typename decltype(Content::parts)::value_type;
  struct Placed {
    const Content* content;
    size_t number;    // of the shading's contents
    Vec3d low, high;  // of all its parts, as far as they are drawn
  };
  struct PartRange {
    const Part* part;
    RayRange range;
  };
  struct Lane {
    const SceneRay* ray;
    RayRange whole;                // that anything may be met in
    RayRange behind;               // that the surround is met in
    std::vector<PartRange> parts;  // of one content, in the order in which the ray enters them
    ContentComposite composite;    // of one content
  };
  void castPacket(std::span<const BoundedRay> rays, MarchCounts& counts);
  // Takes all lanes through their parts of a content.
  void add(const Placed& placed, size_t lanes, MarchCounts& counts);
  bool seesOn(size_t lane) const { return shading_.transmittance(lane) >= drawing_.march.minTransmittance; }

  const SceneDrawing<Content>& drawing_;
  std::vector<Placed> placed_, surround_;
  ShadingOf<Content> shading_;
  std::array<Lane, kRayLanes> lanes_;
};

}  // namespace tessera
