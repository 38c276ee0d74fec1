// What a MODEL|SCENE argument names: something that can be rendered; also a world.
#pragma once

#include <memory>
#include <optional>

#include "base/file.h"
#include "compute/device.h"
#include "scene/capture.h"
#include "scene/exposure_response.h"
#include "scene/surface_coverage.h"
#include "scene/view_renderer.h"

namespace tessera {

class RenderSource {
 public:
  virtual ~RenderSource() = default;
  virtual ViewRenderer& renderer() = 0;
  virtual Mat4d sourceFromWorld() const = 0;
  // Throws Error if the capture's world differs from this source's.
  virtual void requireMatchingWorld(const Capture& capture) const = 0;
  // Returns the names of those photos of the capture's split that this was trained on.
  virtual std::vector<std::string> trainedOnAmong(const Capture& capture, Split split) const = 0;
  // Returns how well its surfaces cover what the training photos show; nothing if training has not checked it.
  virtual std::vector<SurfaceCoverage> coverage() const = 0;
  // Returns how its colours follow the exposure of a photo; nothing if that is not known.
  virtual std::optional<ExposureResponse> exposureResponse() const = 0;
};

struct RenderSourceOptions {
  int threads = 0;                     // for scenes; models use their device's
  int level = 0;                       // for scenes: the finest level of detail to draw
  double memoryMiB = 0;                // for contents of scenes; 0: sceneBudgetBytes (scene_source.h)
  double maximumScreenSpaceError = 0;  // for scenes: see SelectionSettings; 0: the finest everywhere
};

// Throws Error if the folder exists, but holds no scene, and the options are not the standard ones: they apply to
// scenes.
void requireSceneFor(const RenderSourceOptions& options, const fs::path& folder);

// `folder`: of a model, a scene or a world; or a world file. Throws Error if it holds none, if the scene has no such
// level, or if its coarsest level does not fit into memory. Warns if an image was rendered coarser than requested
// because memory was short. Keeps a reference to `device`.
std::unique_ptr<RenderSource> openRenderSource(Device& device, const fs::path& folder,
                                               const RenderSourceOptions& options);

}  // namespace tessera
