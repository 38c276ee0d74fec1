// The window in which people move through a scene or a model.
#pragma once

#include "apps/viewer/navigation.h"
#include "apps/viewer/opened.h"

namespace tessera {

struct WindowOptions {
  int width = 1280, height = 720;
  std::string from;  // the name of a photo whose view to begin with; empty: an overview
  NavigationMode mode = NavigationMode::map;
  bool panels = true;
  fs::path screenshot;  // not empty: a PNG of the window once the picture is whole; then it ends
};

// Until the window is closed. Throws Error where there is no screen, no Vulkan driver that shows pictures on it, or
// nothing that can be viewed.
void runViewer(const ViewOptions& view, const WindowOptions& options);

}  // namespace tessera
