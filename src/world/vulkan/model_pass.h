// Draws the models of a world on the GPU: their colours and z-depths.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "gpu/stream.h"
#include "scene/camera.h"
#include "world/placed_models.h"

namespace tessera {

class ModelPass {
 public:
  // Uploads the models. Throws Error if the device does not rasterise or its memory does not suffice.
  ModelPass(std::shared_ptr<GpuStream> stream, std::span<const Model> models, std::vector<PlacedModel> placed);
  ~ModelPass();
  ModelPass(const ModelPass&) = delete;
  ModelPass& operator=(const ModelPass&) = delete;

  // Queues an image. Throws Error unless the camera is a pinhole.
  void draw(const Camera& camera, const Pose& worldFromCamera);
  // Addresses of the last image: [pixels] words, of which each byte is a colour; [pixels] z-depths, 0 where no model
  // is.
  uint64_t colours() const { return colours_.address(); }
  uint64_t depths() const { return depths_.address(); }
  uint64_t memoryBytes() const { return bytes_; }

 private:
  struct Uploaded {
    GpuBuffer vertices, corners, materials, textures;
    std::vector<GpuBuffer> texels;  // of each texture
    uint32_t count = 0;             // of corners
  };
  template <class T>
  GpuBuffer upload(const std::vector<T>& values);
  Uploaded upload(const Model& model);
  void ensureTarget(const Camera& camera);

  std::shared_ptr<GpuStream> stream_;
  GpuGraphicsPipeline pipeline_;
  std::vector<Uploaded> models_;
  std::vector<PlacedModel> placed_;
  std::shared_ptr<GpuImage> colourImage_, depthImage_;
  std::shared_ptr<const GpuRenderPass> pass_;
  GpuBuffer colours_, depths_;
  uint64_t bytes_ = 0;  // of the models
};

}  // namespace tessera
