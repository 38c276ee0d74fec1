// The window in which the user moves through a scene or a model.
#pragma once

#include "apps/viewer/navigation.h"
#include "apps/viewer/opened.h"

namespace tessera {

struct WindowOptions {
  int width = 1280, height = 720;
  std::string from;  // name of the photo whose pose to begin with; empty: an overview
  NavigationMode mode = NavigationMode::map;
  bool panels = true;
  fs::path screenshot;  // not empty: saves a PNG of the window once the image is complete, then ends
};

// Runs until the window is closed. Throws Error if there is no screen, no Vulkan driver that can present to it, or
// nothing that can be viewed.
void runViewer(const ViewOptions& view, const WindowOptions& options);

}  // namespace tessera
