// An image being rendered on the GPU: its rays, the sums accumulated along them, and the download of the result.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "gpu/stream.h"
#include "render/drawer.h"
#include "render/pixel_directions.h"
#include "shaders/render/arguments_view.h"

namespace tessera {

// An image in GPU memory with the members of RenderedView: device addresses of [pixels][3] and [pixels] floats.
struct GpuRenderedView {
  int width = 0, height = 0;
  uint64_t colour = 0, opacity = 0;
  // [pixels]: z-depth of the surface, where half of what is behind is hidden, in world units; infinite where there is
  // none. 0 unless it was asked for (GpuSurroundings::wantsSurface).
  uint64_t surface = 0;
};

// What else of a world is in the image of a scene.
struct GpuSurroundings {
  // Device address of [pixels] z-depths of what is in front of the scene or behind it, infinite where nothing is; rays
  // end there. It takes the place of ViewRequest::opaqueDepth. 0: nothing.
  uint64_t opaqueDepth = 0;
  bool hasOpaqueDepthChanged = false;  // since the last image, although the camera may not have moved
  bool wantsSurface = false;
  bool endsRays = true;    // rays that hit nothing are opaque, in scenes that declare so
  bool withinBox = false;  // nothing outside the scene's box is drawn
  // Boxes in which nothing is drawn, and boxes in which nothing of the background block is drawn. Each matrix maps
  // scene units to the box, which ranges from -0.5 to 0.5 along each axis.
  std::vector<Mat4d> hidden, hiddenOfBackgroundBlock;
};

class GpuFrame {
 public:
  explicit GpuFrame(std::shared_ptr<GpuStream> stream);

  // Sets what is around the scene in the images that begin afterwards.
  void setSurroundings(GpuSurroundings surroundings) { surroundings_ = std::move(surroundings); }
  const GpuSurroundings& surroundings() const { return surroundings_; }

  // Begins an image with `numbersOfPixel` accumulated values for each pixel (begin_view.comp).
  void begin(const TileFrame& frame, float minTransmittance, uint32_t numbersOfPixel, const ViewRequest& request);
  const arguments::ViewArguments& view() const { return view_; }
  const PixelDirections& directions() const { return pixels_; }
  // Runs a kernel with one invocation for each pixel.
  template <class Arguments>
  void run(const GpuKernel& kernel, const Arguments& arguments) {
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), groups_);
  }
  GpuRenderedView onGpu() const;  // valid until the next begin(), for GPU work queued after this image
  RenderedView drawn();           // downloads the image; waits for the GPU
  std::array<float, 2> opacityAndDepthAt(int x, int y);  // waits for the GPU; an image must have been drawn

 private:
  void ensureCapacity(GpuBuffer& buffer, size_t floats);
  void ensureCapacity(const Camera& camera, uint32_t numbersOfPixel);
  void applySurroundings();

  std::shared_ptr<GpuStream> stream_;
  GpuKernel begin_;
  ThreadPool pool_;
  PixelDirections pixels_;
  Camera camera_;  // of the last image
  GpuSurroundings surroundings_;
  GpuBuffer directions_, opaqueDepth_, state_, drawn_, surface_, boxes_;
  arguments::ViewArguments view_ = {};
  Groups groups_;
};

}  // namespace tessera
