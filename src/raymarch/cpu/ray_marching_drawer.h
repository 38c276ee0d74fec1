// Draws contents of one ray-marched representation.
#pragma once

#include "raymarch/cpu/draw_scene.h"

namespace tessera {

// Content: as of SceneDrawing; contents of views are ContentOf<Content>. drawScene<Content> must be instantiated
// somewhere.
template <class Content_>
class RayMarchingDrawer final : public CpuDrawer {
 public:
  // `skippingModes`: of "distances", "cells" and "none" those that the content's march knows.
  explicit RayMarchingDrawer(std::vector<std::string_view> skippingModes) : skippingModes_(std::move(skippingModes)) {}

  RenderedView draw(const SceneView<Content>& view, const PictureRequest& request, const DrawSettings& settings,
                    ThreadPool& pool, DrawCounts& counts) override {
    SceneDrawing<Content_> drawing;
    drawing.frame = view.frame;
    for (const DrawnContent<Content>& drawn : view.frontToBack) {
      drawing.frontToBack.emplace_back(&contentAs<Content_>(*drawn.content), drawn.low, drawn.high);
    }
    if (view.surround != nullptr) {
      drawing.surround = &contentAs<Content_>(*view.surround);
    } else if (view.pinned != nullptr) {
      drawing.ofNothing = &contentAs<Content_>(*view.pinned);
    }
    drawing.march.minTransmittance = settings.minTransmittance;
    drawing.march.skipEmptySpace = settings.skipping != "none";
    drawing.march.useDistances = settings.skipping != "cells";
    directions_.update(request.camera, pool);
    return drawScene(drawing, directions_, request.worldFromCamera, request.opaqueDepth, pool, &counts);
  }
  std::vector<std::string_view> skippingModes() const override { return skippingModes_; }

 private:
  std::vector<std::string_view> skippingModes_;
  PixelDirections directions_;
};

}  // namespace tessera
