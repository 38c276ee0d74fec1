// For tests: the CPU renderer of `volume` scenes.
#pragma once

#include "render/cpu/scene_renderer.h"
#include "representations/volume/cpu/volume_drawer.h"

namespace tessera {

class VolumeRenderer final : public SceneRenderer {
 public:
  VolumeRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source,
                 const SceneRendererSettings& settings)
      : SceneRenderer(makeVolumeDrawer(), frame, std::move(tree), std::move(source), settings) {}
};

}  // namespace tessera
