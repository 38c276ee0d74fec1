// The interface between a renderer and the drawers of a representation, and the drawer on the CPU.
// render/vulkan/gpu_drawer.h is its counterpart on the GPU. Renderers select what is drawn (render/scene_tiles.h) and
// are independent of representations; a drawer draws the contents that it is given and is independent of tiles.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "base/threads.h"
#include "render/tile_frame.h"
#include "render/tile_selection.h"
#include "scene/view_renderer.h"
#include "tiles/content.h"

namespace tessera {

// The part of a content that lies in a box, whose sides may be infinite.
template <class ResidentContent>
struct DrawnContent {
  const ResidentContent* content;
  Vec3d low, high;  // scene units
  // Drawn in those pixels whose threshold lies in [first, second); all thresholds are from 0 to 1. Other shares occur
  // only where GpuDrawer::crossFades() is true.
  std::pair<float, float> share = {0, 1};

  DrawnContent(const ResidentContent* content)  // NOLINT(google-explicit-constructor): the whole content
      : DrawnContent(content, Vec3d::Constant(-INFINITY), Vec3d::Constant(INFINITY)) {}
  DrawnContent(const ResidentContent* content, const Vec3d& low, const Vec3d& high)
      : content(content), low(low), high(high) {}
};

// The part of a scene that a camera sees. ResidentContent: Content (in CPU memory) or GpuContent (in GPU memory).
template <class ResidentContent>
struct SceneView {
  TileFrame frame;
  // Ordered front to back for every ray of the camera (render/tile_tree.h).
  std::vector<DrawnContent<ResidentContent>> frontToBack;
  // Optional: drawn behind the frame's box, and alone for rays that miss the box.
  const ResidentContent* backgroundBlock = nullptr;
  // A content that is always in memory, whatever the view; null if the scene is empty.
  const ResidentContent* pinned = nullptr;
};

struct ViewRequest {
  const Camera& camera;
  const Pose& worldFromCamera;
  const ImageF* opaqueDepth = nullptr;  // see ViewRenderer::render
};

struct DrawSettings {
  float minTransmittance = 1.0f / 255;  // a ray ends when its transmittance falls below this; 0: never
  // One of CpuDrawer::skippingModes(); empty: the first of them.
  std::string_view skipping;
  // Whether the image must be a function of the request alone: every layer evaluated, no dithering, no history of
  // earlier frames. Otherwise the drawer may use whatever looks best in a sequence of frames.
  bool exact = true;
};

// Counters that add up over images.
struct DrawCounts {
  uint64_t steps = 0;    // positions visited along rays
  uint64_t samples = 0;  // positions at which the content was evaluated
};

// Draws contents of a representation on the CPU. It is the reference that defines what these contents look like. Each
// renderer owns one.
class CpuDrawer {
 public:
  CpuDrawer() = default;
  CpuDrawer(const CpuDrawer&) = delete;
  CpuDrawer& operator=(const CpuDrawer&) = delete;
  virtual ~CpuDrawer() = default;

  // Returns an upper bound of the memory in bytes that a prepared content takes, including what drawing builds for it.
  // `decodedBytes`: the memory of the content as it was decoded.
  virtual uint64_t residentBytes(uint64_t decodedBytes) const { return decodedBytes; }
  // Returns the same for a shared resource, which is counted once for all contents that use it.
  virtual uint64_t residentBytesOfResource(uint64_t decodedBytes) const { return decodedBytes; }
  // The factor of SelectionSettings: larger where contents take long to load.
  virtual double hysteresis() const { return kUsualHysteresis; }
  // Turns a decoded content into one that draw() accepts. Called by several threads at a time. `threads`: of its own
  // work on the content; 0: as many as the machine has.
  virtual std::unique_ptr<Content> prepare(std::unique_ptr<Content> content, int /*threads*/) const { return content; }

  // Renders a view (see ViewRenderer::render). The image does not depend on the number of threads. Adds to `counts`.
  virtual RenderedView draw(const SceneView<Content>& view, const ViewRequest& request, const DrawSettings& settings,
                            ThreadPool& pool, DrawCounts& counts) = 0;

  // Modes of empty-space skipping, the fastest first; "none", if present, visits every step. All modes produce the same
  // image.
  virtual std::vector<std::string_view> skippingModes() const { return {"none"}; }
};

}  // namespace tessera
