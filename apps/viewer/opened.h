// What `tessera view` was given: where it stands, and what draws it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/tessera/drawable.h"
#include "apps/viewer/picture_source.h"
#include "eval/render_views.h"
#include "gpu/context.h"

namespace tessera {

struct ViewOptions {
  fs::path folder;
  fs::path views;  // a capture whose photos' views can be gone to; empty: a model's own
  DeviceOptions device = {.kind = "auto"};
  double memoryMiB = 1024;  // for the contents of a scene
  double mostPixels = 1.5;  // SelectionSettings
};

struct Place {
  Vec3d low = -Vec3d::Ones(), high = Vec3d::Ones();  // of what there is to be seen, in the world
  std::vector<NamedView> views;                      // of photos
};

// Throws Error where the folder holds neither a scene nor a model.
void requireViewable(const fs::path& folder);
Place placeOf(const ViewOptions& options);

// Of a model that has not saved anything yet: waits until it has.
void waitForModel(const fs::path& folder);

// `window`: of the device that shows pictures, and draws scenes unless the processor is to. Throws Error as
// openDrawable and GpuSceneRenderer do.
std::unique_ptr<PictureSource> openPictures(const ViewOptions& options,
                                            const std::shared_ptr<const GpuContext>& window);

}  // namespace tessera
