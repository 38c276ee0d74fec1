// A picture that is being drawn on a graphics card: its rays, what is added up along them, and what comes back.
#pragma once

#include <array>
#include <memory>

#include "gpu/stream.h"
#include "render/drawer.h"
#include "render/pixel_directions.h"
#include "shaders/render/arguments_view.h"

namespace tessera {

// A picture on the card, as RenderedView has it: addresses of [pixels][3] and [pixels] floats.
struct DrawnOnCard {
  int width = 0, height = 0;
  uint64_t colour = 0, opacity = 0;
};

class GpuPicture {
 public:
  explicit GpuPicture(std::shared_ptr<GpuStream> stream);

  // Begins a picture, with so many numbers of each pixel to add up (begin_view.comp).
  void begin(const TileFrame& frame, float minTransmittance, uint32_t numbersOfPixel, const PictureRequest& request);
  const arguments::ViewArguments& view() const { return view_; }
  // Runs a kernel for each pixel.
  template <class Arguments>
  void run(const GpuKernel& kernel, const Arguments& arguments) {
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), groups_);
  }
  DrawnOnCard onCard() const;  // valid until the next one begins, for what the card does after it
  RenderedView drawn();        // waits
  std::array<float, 2> opacityAndDepthAt(int x, int y);  // waits; there must be a picture

 private:
  void makeRoom(GpuBuffer& buffer, size_t floats);
  void makeRoom(const Camera& camera, uint32_t numbersOfPixel);

  std::shared_ptr<GpuStream> stream_;
  GpuKernel begin_;
  ThreadPool pool_;
  PixelDirections pixels_;
  Camera camera_;  // of the last picture
  GpuBuffer directions_, opaqueDepth_, state_, drawn_;
  arguments::ViewArguments view_ = {};
  Groups groups_;
};

}  // namespace tessera
