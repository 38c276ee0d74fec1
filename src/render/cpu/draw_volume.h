// A picture of contents in memory: the definition of what a `volume` scene looks like, on the processor.
#pragma once

#include <cmath>
#include <vector>

#include "base/threads.h"
#include "render/cpu/volume_shading.h"
#include "scene/view_renderer.h"

namespace tessera {

// Of a content, the part in a box, whose sides may be infinite.
struct DrawnVolume {
  const VolumeContent* content;
  Vec3d low, high;  // scene units

  DrawnVolume(const VolumeContent* content)  // NOLINT(google-explicit-constructor): all of it
      : DrawnVolume(content, Vec3d::Constant(-INFINITY), Vec3d::Constant(INFINITY)) {}
  DrawnVolume(const VolumeContent* content, const Vec3d& low, const Vec3d& high)
      : content(content), low(low), high(high) {}
};

struct VolumeDrawing {
  VolumeFrame frame;
  // In an order that is front to back for every ray of the camera (render/tile_tree.h).
  std::vector<DrawnVolume> frontToBack;
  // Optional: seen behind the frame's box, or alone by rays that miss it.
  const VolumeContent* surround = nullptr;
  MarchSettings march;
};

// As ViewRenderer::render. The picture does not depend on the number of threads. `counts`: optional, added to.
RenderedView drawVolume(const VolumeDrawing& drawing, const Camera& camera, const Pose& worldFromCamera,
                        const ImageF* opaqueDepth, ThreadPool& pool, MarchCounts* counts = nullptr);

// One ray after another through a drawing, which must outlive this. Not for several threads at a time.
class VolumeRayCaster {
 public:
  explicit VolumeRayCaster(const VolumeDrawing& drawing);

  // `far`: scene units.
  BlendedRay cast(const SceneRay& ray, double far, MarchCounts& counts);

 private:
  struct Placed {
    const VolumeContent* content;
    DeferredShader shader;
    Vec3d low, high;  // of all its parts, as far as they are drawn
  };
  struct PartRange {
    const VolumePart* part;
    RayRange range;
  };
  ContentComposite march(const Placed& placed, const SceneRay& ray, const std::vector<PartRange>& parts,
                         float transmittanceBefore, MarchCounts& counts) const;

  const VolumeDrawing& drawing_;
  std::vector<Placed> placed_, surround_;
  std::vector<PartRange> parts_;  // of one ray and content
};

}  // namespace tessera
