// Renders ray-marched contents on the CPU. This defines what such scenes look like. The templates are defined in
// draw_scene-inl.h and instantiated once for each content, in the source file that makes its drawer.
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

// Content must have parts and a specialisation of Shading.
template <class Content>
struct SceneDrawing {
  TileFrame frame;
  // Front to back for every ray of the camera (see render/tile_tree.h).
  std::vector<DrawnContent<Content>> frontToBack;
  // Optional. Visible behind the frame's box, and to rays that miss the box.
  const Content* backgroundBlock = nullptr;
  MarchSettings march;
  // Optional: the content from which shading takes the colour of rays that meet nothing, though no ray is marched
  // through it. Without it, that is the background block, or else the last content.
  const Content* backgroundContent = nullptr;
};

// Renders a view; see ViewRenderer::render. The result does not depend on the number of threads. `counts` is optional;
// the numbers of steps and samples are added to it.
template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const PixelDirections& pixels, const Pose& worldFromCamera,
                       const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts = nullptr);
template <class Content>
RenderedView drawScene(const SceneDrawing<Content>& drawing, const Camera& camera, const Pose& worldFromCamera,
                       const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts = nullptr);

// Casts rays through a drawing, which must outlive the caster. Not thread-safe.
template <class Content>
class RayCaster {
 public:
  explicit RayCaster(const SceneDrawing<Content>& drawing);

  // Casts `rays` and writes one pixel for each. `pixels`: [rays].
  void cast(std::span<const BoundedRay> rays, std::span<DrawnPixel> pixels, MarchCounts& counts);
  DrawnPixel cast(const SceneRay& ray, double far, MarchCounts& counts);

 private:
  using Part = typename decltype(Content::parts)::value_type;
  struct Placed {
    const Content* content;
    size_t number;    // among the contents of the shading
    Vec3d low, high;  // box around all its parts, clipped to the cells where it is drawn
  };
  struct PartRange {
    const Part* part;
    RayRange range;
  };
  struct Lane {
    const SceneRay* ray;
    RayRange whole;                // where anything may be visible
    RayRange behind;               // where the background block is visible
    std::vector<PartRange> parts;  // of the current content, in the order in which the ray enters them
    ContentComposite composite;    // of the current content
  };
  void castPacket(std::span<const BoundedRay> rays, MarchCounts& counts);
  // Marches all lanes through their parts of a content and adds the results to the shading.
  void add(const Placed& placed, size_t lanes, MarchCounts& counts);
  bool seesOn(size_t lane) const { return shading_.transmittance(lane) >= drawing_.march.minTransmittance; }

  const SceneDrawing<Content>& drawing_;
  std::vector<Placed> placed_, backgroundBlock_;
  ShadingOf<Content> shading_;
  std::array<Lane, kRayLanes> lanes_;
};

}  // namespace tessera
