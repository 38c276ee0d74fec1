// An image being rendered on the GPU: its rays, the sums accumulated along them, and the download of the result.
#pragma once

#include <array>
#include <memory>

#include "gpu/stream.h"
#include "render/drawer.h"
#include "render/pixel_directions.h"
#include "shaders/render/arguments_view.h"

namespace tessera {

// An image in GPU memory with the members of RenderedView: device addresses of [pixels][3] and [pixels] floats.
struct GpuRenderedView {
  int width = 0, height = 0;
  uint64_t colour = 0, opacity = 0;
};

class GpuFrame {
 public:
  explicit GpuFrame(std::shared_ptr<GpuStream> stream);

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

  std::shared_ptr<GpuStream> stream_;
  GpuKernel begin_;
  ThreadPool pool_;
  PixelDirections pixels_;
  Camera camera_;  // of the last image
  GpuBuffer directions_, opaqueDepth_, state_, drawn_;
  arguments::ViewArguments view_ = {};
  Groups groups_;
};

}  // namespace tessera
