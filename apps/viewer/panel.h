// What a window shows beside the picture: how to move, where one is, what is drawn and how fast.
#pragma once

#include "apps/viewer/navigation.h"
#include "apps/viewer/picture_source.h"
#include "eval/render_views.h"

namespace tessera {

// What people can set, and what they are told.
struct PanelState {
  float fieldOfView = 50;  // degrees, from the lower to the upper edge
  int view = -1;           // the photo's that was gone to last
  bool isShown = true;
  double milliseconds = 0;  // from one picture to the next, while the camera moves
  bool isWhole = false;     // the picture
};

// What somebody asked for.
struct PanelWish {
  bool all = false;  // to see all there is
  int view = -1;     // to go to a photo's view
};

PanelWish showPanel(const std::string& title, Navigation& navigation, const std::vector<NamedView>& views,
                    const PictureSource::Facts& facts, PanelState& state);

}  // namespace tessera
