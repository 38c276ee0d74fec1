// The pixels of one picture as rays on a device, a piece at a time: what draws a model, or looks at it through a photo,
// begins with this.
#pragma once

#include "compute/device.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"
#include "train/scene_frame.h"

namespace tessera {

// Every `stride`-th pixel of [firstX, endX) × [firstY, endY), row by row; they may lie beside the picture.
struct PixelLattice {
  int firstX = 0, firstY = 0, endX = 0, endY = 0, stride = 1;

  static PixelLattice whole(const Camera& camera) { return {0, 0, camera.width, camera.height, 1}; }
  size_t columns() const { return static_cast<size_t>((endX - firstX + stride - 1) / stride); }
  size_t rows() const { return static_cast<size_t>((endY - firstY + stride - 1) / stride); }
  size_t count() const { return columns() * rows(); }
};

class PictureRays {
 public:
  // At most `mostRays` a piece. Keeps a reference to `device`.
  PictureRays(Device& device, uint32_t mostRays);

  // `opaqueDepth`: optional, z-depth in world units where rays end; needs to live as long as pieces are made.
  void begin(const RayCamera& camera, const SceneFrame& frame, const PixelLattice& lattice,
             const ImageF* opaqueDepth = nullptr);

  struct Piece {
    uint32_t rays = 0;
    Slice<const float> origins, directions;  // [rays][3], scene units
    Slice<const float> far;                  // [rays], with opaqueDepth
  };
  // Pixels [first, first + most) of the lattice, or fewer. Valid until the next one.
  Piece piece(size_t first, uint32_t most);
  // Rays through pixels of one's own choice, [rays][2], at most `mostRays`; no far. Valid until the next piece.
  Piece through(std::span<const float> pixels);
  // Of a ray of the last piece: the z-depth in world units of what lies at that distance in scene units.
  float depthOf(uint32_t ray, float distance) const { return distance * cosine(ray) / scale_; }

 private:
  float cosine(uint32_t ray) const;  // of the angle with the optical axis

  Device& device_;
  uint32_t mostRays_;
  PixelLattice lattice_;
  const ImageF* opaqueDepth_ = nullptr;
  float forward_[3] = {0, 0, 1}, scale_ = 1;
  std::vector<float> hostDirections_;
  Array<RayCamera> camera_;
  Array<uint32_t> cameraOfRay_;
  Array<float> pixels_, origins_, directions_, far_;
};

}  // namespace tessera
