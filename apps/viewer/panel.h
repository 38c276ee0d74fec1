// The panel beside the image: navigation controls, position, what is drawn and how fast.
#pragma once

#include "apps/viewer/frame_source.h"
#include "apps/viewer/navigation.h"
#include "eval/render_views.h"

namespace tessera {

// The settings that the user can change, and the values that are displayed.
struct PanelState {
  float fieldOfView = 50;  // degrees, vertical
  int view = -1;           // index of the photo that was visited last
  bool isShown = true;
  double milliseconds = 0;  // between frames, while the camera moves
  bool isComplete = false;  // whether the image is complete: see ShownPicture
};

// What the user requested in this frame.
struct PanelAction {
  bool all = false;  // to see everything
  int view = -1;     // to go to the pose of this photo
};

PanelAction showPanel(const std::string& title, Navigation& navigation, const std::vector<NamedView>& views,
                      const FrameSource::Facts& facts, PanelState& state);

}  // namespace tessera
