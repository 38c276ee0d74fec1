// Opens what `tessera view` was given: its location, and the source of its frames.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/tessera/render_source.h"
#include "apps/viewer/frame_source.h"
#include "eval/render_views.h"
#include "gpu/context.h"
#include "world/world_file.h"

namespace tessera {

struct ViewOptions {
  fs::path folder;  // of a scene, a model or a world; or a world file
  fs::path views;   // a capture whose photo poses can be visited; empty: those of a model
  DeviceOptions device = {.kind = "auto"};
  double memoryMiB = 1024;               // for contents of a scene
  double maximumScreenSpaceError = 1.5;  // see SelectionSettings
};

struct Place {
  Vec3d low = -Vec3d::Ones(), high = Vec3d::Ones();  // box of what can be seen, in the world
  std::vector<NamedView> views;                      // bookmarks of a world, and poses of photos
};

// A world that is to be viewed. It is read once, and its embedded files are not needed when it has been opened.
struct WorldToView {
  fs::path file;
  World world;
};

// Extends the place's box by a box that is given in other axes.
void enclose(const Vec3d& low, const Vec3d& high, const std::function<Vec3d(const Vec3d&)>& toWorld, Place& place);

// Throws Error if there is neither a scene nor a model nor a world.
void requireViewable(const fs::path& folder);
// Returns the world that the options name, or nothing if they name a scene or a model. Throws Error as readWorldFile
// does.
std::optional<WorldToView> readWorldToView(const ViewOptions& options);
// Reads the box and the photo poses of a scene, model or world. `world`: from readWorldToView. Throws Error if the box
// cannot be read, or if the capture that `options.views` names cannot be read or is of another world. If a model's own
// capture cannot be used, warns and returns no poses.
Place loadPlace(const ViewOptions& options, const std::optional<WorldToView>& world);

// If a model in training has not saved anything yet, waits until it has.
void waitForModel(const fs::path& folder);

// `window`: the context of the device that shows the frames, which also renders scenes unless the CPU is chosen. Throws
// Error as openRenderSource and GpuSceneRenderer do.
std::unique_ptr<FrameSource> openPictures(const ViewOptions& options, const std::optional<WorldToView>& world,
                                          const std::shared_ptr<const GpuContext>& window);

}  // namespace tessera
