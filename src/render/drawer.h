// How contents of one representation become a picture: what a renderer hands to a drawer, and the drawer on the CPU.
// render/vulkan/gpu_drawer.h is its twin on the GPU. Renderers choose what is drawn (render/scene_tiles.h) and know no
// representation; a drawer draws what it is given and knows nothing of tiles.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "base/threads.h"
#include "render/tile_frame.h"
#include "scene/view_renderer.h"
#include "tiles/content.h"

namespace tessera {

// Of a content, the part in a box, whose sides may be infinite.
template <class Held>
struct DrawnContent {
  const Held* content;
  Vec3d low, high;  // scene units

  DrawnContent(const Held* content)  // NOLINT(google-explicit-constructor): all of it
      : DrawnContent(content, Vec3d::Constant(-INFINITY), Vec3d::Constant(INFINITY)) {}
  DrawnContent(const Held* content, const Vec3d& low, const Vec3d& high) : content(content), low(low), high(high) {}
};

// What of a scene a camera sees. Held: where contents live, Content or GpuContent.
template <class Held>
struct SceneView {
  TileFrame frame;
  // In an order that is front to back for every ray of the camera (render/tile_tree.h).
  std::vector<DrawnContent<Held>> frontToBack;
  // Optional: seen behind the frame's box, or alone by rays that miss it.
  const Held* surround = nullptr;
  // One that is always in memory, whatever is in view; null where the scene is empty.
  const Held* pinned = nullptr;
};

struct PictureRequest {
  const Camera& camera;
  const Pose& worldFromCamera;
  const ImageF* opaqueDepth = nullptr;  // as of ViewRenderer::render
};

struct DrawSettings {
  float minTransmittance = 1.0f / 255;  // rays end where less than this would be seen; 0: never
  // Which of CpuDrawer::skippingModes() empty space is passed over by; empty: the first.
  std::string_view skipping;
  // A picture that is a function of the request alone: every layer, no dithering, no earlier pictures. Else what looks
  // best from one picture to the next.
  bool exact = true;
};

// Adds up over pictures.
struct DrawCounts {
  uint64_t steps = 0;    // places that were looked at
  uint64_t samples = 0;  // of them evaluated
};

// Draws on the CPU: the definition of what contents of a representation look like. One for each renderer.
class CpuDrawer {
 public:
  CpuDrawer() = default;
  CpuDrawer(const CpuDrawer&) = delete;
  CpuDrawer& operator=(const CpuDrawer&) = delete;
  virtual ~CpuDrawer() = default;

  // What a content takes in memory at most once it is prepared, where it takes `decodedBytes` as it is decoded: what
  // drawing builds besides counts too.
  virtual uint64_t residentBytes(uint64_t decodedBytes) const { return decodedBytes; }
  // Likewise of a resource, once for all contents that keep it: what drawing builds of it besides counts too.
  virtual uint64_t residentBytesOfResource(uint64_t decodedBytes) const { return decodedBytes; }
  // Makes of a content as it was decoded one that draw() takes. Called by several threads at a time.
  virtual std::unique_ptr<Content> prepare(std::unique_ptr<Content> content) const { return content; }

  // As ViewRenderer::render. The picture does not depend on the number of threads. `counts` is added to.
  virtual RenderedView draw(const SceneView<Content>& view, const PictureRequest& request, const DrawSettings& settings,
                            ThreadPool& pool, DrawCounts& counts) = 0;

  // Ways of passing over empty space, the fastest first; "none", if it is among them, looks everywhere. All of them
  // make the same picture.
  virtual std::vector<std::string_view> skippingModes() const { return {"none"}; }
};

}  // namespace tessera
