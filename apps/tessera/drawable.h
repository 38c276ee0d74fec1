// What a MODEL|SCENE argument names: something that can be drawn.
#pragma once

#include <memory>

#include "base/file.h"
#include "compute/device.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"

namespace tessera {

class Drawable {
 public:
  virtual ~Drawable() = default;
  virtual ViewRenderer& renderer() = 0;
  virtual Mat4d sourceFromWorld() const = 0;
  // Throws Error when the capture's world is another one.
  virtual void requireWorldOf(const Capture& capture) const = 0;
  virtual std::vector<std::string> trainedOnAmong(const Capture& capture, Split split) const = 0;
};

struct DrawableOptions {
  int threads = 0;        // of scenes; models have their device's
  int level = 0;          // of detail of scenes: the finest to draw
  double memoryMiB = 0;   // for the contents of scenes; 0: sceneBudgetBytes (scene_source.h)
  double mostPixels = 0;  // of scenes: SelectionSettings; the finest everywhere
};

// Throws Error when the folder holds neither, the scene has no such level, or its coarsest does not fit. Warns when a
// picture was drawn coarser than asked for, as memory was short. Keeps a reference to `device`.
std::unique_ptr<Drawable> openDrawable(Device& device, const fs::path& folder, const DrawableOptions& options);

}  // namespace tessera
