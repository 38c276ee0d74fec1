#include "representations/mesh/vulkan/placed_parts.h"

#include <algorithm>
#include <utility>

#include "representations/mesh/vulkan/gpu_mesh_content.h"
#include "shaders/representations/mesh/arguments_mesh.h"

namespace tessera {
namespace {

constexpr size_t kDrawsOfPass = 4096;  // half of what fits into the arguments of a pass

arguments::PlacedPartArguments placePart(const GpuMeshContent::Part& part, const DrawnContent<GpuContent>& drawn,
                                         const Vec3d& eye, bool isBackground) {
  arguments::PlacedPartArguments placed = {};
  placed.part = part.address;
  for (int axis = 0; axis < 3; ++axis) placed.origin[axis] = static_cast<float>(part.origin[axis] - eye[axis]);
  placed.step = static_cast<float>(part.step);
  for (int axis = 0; axis < 2; ++axis) {
    placed.low[axis] = static_cast<float>(drawn.low[axis] - eye[axis]);
    placed.high[axis] = static_cast<float>(drawn.high[axis] - eye[axis]);
  }
  placed.isBackground = isBackground ? 1 : 0;
  placed.share[0] = drawn.share.first;
  placed.share[1] = drawn.share.second;
  return placed;
}

}  // namespace

void drawParts(GpuStream& stream, const GpuGraphicsPipeline& pipeline, uint64_t view, std::span<const DrawnPart> parts,
               const GpuRenderPass& first, const GpuRenderPass& next) {
  std::vector<arguments::DrawTrianglesArguments> all;
  for (const DrawnPart& part : parts) all.push_back({view, part.number, 0});
  std::vector<DrawCall> draws;
  for (size_t i = 0; i < parts.size(); ++i) {
    draws.push_back({&pipeline, std::as_bytes(std::span(&all[i], 1)), DrawCount{.vertices = 3 * parts[i].triangles}});
  }
  stream.draw(first, std::span(draws).first(std::min(kDrawsOfPass, draws.size())));
  for (size_t from = kDrawsOfPass; from < draws.size(); from += kDrawsOfPass)
    stream.draw(next, std::span(draws).subspan(from, std::min(kDrawsOfPass, draws.size() - from)));
}

PlacedParts::~PlacedParts() {
  if (placed_) stream_->deferDestroy(std::move(placed_));
}

bool PlacedParts::place(const SceneView<GpuContent>& view, const Vec3d& eye) {
  drawn_.clear();
  maxWidth_ = kMeshFeatures + kMeshHarmonics;
  std::vector<arguments::PlacedPartArguments> all;
  const auto add = [&](const DrawnContent<GpuContent>& drawn, bool isBackground) {
    const auto& content = static_cast<const GpuMeshContent&>(*drawn.content);
    maxWidth_ = std::max(maxWidth_, content.maxWidth);
    for (const GpuMeshContent::Part& part : content.parts) {
      drawn_.push_back({static_cast<uint32_t>(all.size()), part.triangles});
      all.push_back(placePart(part, drawn, eye, isBackground));
    }
  };
  for (const DrawnContent<GpuContent>& drawn : view.frontToBack) add(drawn, false);
  ofTiles_ = drawn_.size();
  if (view.backgroundBlock != nullptr) add(view.backgroundBlock, true);
  std::vector<ShownPart> shown;
  for (const arguments::PlacedPartArguments& part : all) shown.push_back({part.part, part.share[0], part.share[1]});
  const bool isChanged = shown != std::exchange(shown_, shown);
  if (all.empty()) return isChanged;
  const auto bytes = std::as_bytes(std::span(all));
  if (placed_.bytes() < bytes.size()) {
    if (placed_) stream_->deferDestroy(std::move(placed_));
    placed_ = GpuBuffer();
    placed_ = stream_->makeBuffer(2 * bytes.size());
  }
  stream_->upload(placed_, 0, bytes);
  return isChanged;
}

}  // namespace tessera
