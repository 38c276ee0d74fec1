// The parts of contents that a view shows, placed relative to the eye.
#pragma once

#include <span>
#include <vector>

#include "render/vulkan/gpu_drawer.h"

namespace tessera {

// The triangles of a part in a view.
struct DrawnPart {
  uint32_t number = 0;  // among the placed parts of the view
  uint32_t triangles = 0;
};

// Queues the drawing of the triangles of parts: the first in the pass `first`, those that exceed what a pass may draw
// in `next`. `view`: address of the MeshViewArguments.
void drawParts(GpuStream& stream, const GpuGraphicsPipeline& pipeline, uint64_t view, std::span<const DrawnPart> parts,
               const GpuRenderPass& first, const GpuRenderPass& next);

class PlacedParts {
 public:
  explicit PlacedParts(std::shared_ptr<GpuStream> stream) : stream_(std::move(stream)) {}
  ~PlacedParts();
  PlacedParts(const PlacedParts&) = delete;
  PlacedParts& operator=(const PlacedParts&) = delete;

  // Places the parts of a view. `eye`: in the scene. Returns whether the parts are others than those before.
  bool place(const SceneView<GpuContent>& view, const Vec3d& eye);

  std::span<const DrawnPart> all() const { return drawn_; }
  std::span<const DrawnPart> ofTiles() const { return std::span(drawn_).first(ofTiles_); }
  std::span<const DrawnPart> ofBackground() const { return std::span(drawn_).subspan(ofTiles_); }
  uint64_t address() const { return placed_.address(); }  // of the PlacedPartArguments
  uint32_t maxWidth() const { return maxWidth_; }         // of the layers of the parts' networks

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer placed_;
  std::vector<DrawnPart> drawn_;  // those of tiles first
  size_t ofTiles_ = 0;
  struct ShownPart {
    uint64_t address = 0;
    float low = 0, high = 1;  // its share of pixels
    bool operator==(const ShownPart&) const = default;
  };
  std::vector<ShownPart> shown_;
  uint32_t maxWidth_ = 0;
};

}  // namespace tessera
