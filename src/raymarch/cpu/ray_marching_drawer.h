// The CPU drawer of a ray-marched representation.
#pragma once

#include "raymarch/cpu/draw_scene.h"

namespace tessera {

// Content_ is a content as for SceneDrawing; the contents of views must be ContentOf<Content_>. drawScene<Content_>
// must be instantiated in some source file.
template <class Content_>
class RayMarchingDrawer final : public CpuDrawer {
 public:
  // `skippingModes`: those of "distances", "cells" and "none" that marching through the content supports.
  explicit RayMarchingDrawer(std::vector<std::string_view> skippingModes) : skippingModes_(std::move(skippingModes)) {}

  RenderedView draw(const SceneView<Content>& view, const ViewRequest& request, const DrawSettings& settings,
                    ThreadPool& pool, DrawCounts& counts) override {
    SceneDrawing<Content_> drawing;
    drawing.frame = view.frame;
    for (const DrawnContent<Content>& drawn : view.frontToBack) {
      drawing.frontToBack.emplace_back(&contentAs<Content_>(*drawn.content), drawn.low, drawn.high);
    }
    if (view.backgroundBlock != nullptr) {
      drawing.backgroundBlock = &contentAs<Content_>(*view.backgroundBlock);
    } else if (view.pinned != nullptr) {
      drawing.backgroundContent = &contentAs<Content_>(*view.pinned);
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
