// Generates the rays through the pixels of one image on a device, a piece at a time: for rendering a model, or for
// finding out what a photo sees of it.
#pragma once

#include <functional>

#include "compute/device.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"
#include "train/scene_frame.h"

namespace tessera {

// Every `stride`-th pixel of [firstX, endX) × [firstY, endY), row by row; they may lie outside the image.
struct PixelLattice {
  int firstX = 0, firstY = 0, endX = 0, endY = 0, stride = 1;

  static PixelLattice whole(const Camera& camera) { return {0, 0, camera.width, camera.height, 1}; }
  size_t columns() const { return static_cast<size_t>((endX - firstX + stride - 1) / stride); }
  size_t rows() const { return static_cast<size_t>((endY - firstY + stride - 1) / stride); }
  size_t count() const { return columns() * rows(); }
};

// The most rays of an image, and the most of their samples, that a renderer evaluates at a time; rays whose samples do
// not fit are in its next batch. A GPU needs more of them than a CPU before all its units are busy.
struct ImageBatch {
  static constexpr uint32_t kLeastSamples = 1 << 16;
  uint32_t rays = 1 << 12, samples = kLeastSamples;

  // Larger if the device is a GPU with memory of its own.
  static ImageBatch on(const Device& device);
};

class ImageRays {
 public:
  // Pieces have at most `maxRays` rays. Keeps a reference to `device`.
  ImageRays(Device& device, uint32_t maxRays);

  // Starts an image. `opaqueDepth`: optional, the z-depth in world units at which rays end; must remain valid while
  // pieces are generated.
  void begin(const RayCamera& camera, const SceneFrame& frame, const PixelLattice& lattice,
             const ImageF* opaqueDepth = nullptr);

  struct Piece {
    uint32_t rays = 0;
    Slice<const float> origins, directions;  // [rays][3], scene units
    Slice<const float> far;                  // [rays], scene units, with opaqueDepth
  };
  // Returns the rays of pixels [first, first + maximum) of the lattice, or fewer. Valid until the next piece.
  Piece piece(size_t first, uint32_t maximum);
  // What a renderer made of a piece: the rays that fitted into its buffers, at least one, and the number of their
  // samples in the fullest buffer.
  struct Rendered {
    uint32_t rays = 0, samples = 0;
  };
  // Calls `render(piece, first)` for pieces that together are the whole lattice; `first`: the pixel of a piece's first
  // ray. Rays that do not fit are in the next piece, whose size is chosen so that all will. `sampleCapacity`: of a
  // buffer.
  void renderInPieces(uint32_t sampleCapacity, const std::function<Rendered(const Piece&, size_t first)>& render);
  // Returns rays through the given pixel positions, [rays][2], at most `maxRays`; without far. Valid until the next
  // piece.
  Piece through(std::span<const float> pixels);
  // Converts a distance in scene units along a ray of the last piece into z-depth in world units.
  float toViewDepth(uint32_t ray, float distance) const { return distance * cosine(ray) / scale_; }

 private:
  float cosine(uint32_t ray) const;  // of the angle between ray and optical axis

  Device& device_;
  uint32_t maxRays_;
  PixelLattice lattice_;
  const ImageF* opaqueDepth_ = nullptr;
  float forward_[3] = {0, 0, 1}, scale_ = 1;
  std::vector<float> hostDirections_;
  Array<RayCamera> camera_;
  Array<uint32_t> cameraOfRay_;
  Array<float> pixels_, origins_, directions_, far_;
};

}  // namespace tessera
