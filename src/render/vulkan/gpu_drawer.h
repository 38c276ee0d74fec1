// How contents of one representation become a picture on a GPU: the twin of render/drawer.h's CpuDrawer, which its
// pictures are held against.
#pragma once

#include "render/drawer.h"
#include "render/vulkan/gpu_content.h"
#include "render/vulkan/gpu_picture.h"

namespace tessera {

// One for each renderer. Everything that it asks of the GPU goes through one stream.
class GpuDrawer {
 public:
  GpuDrawer() = default;
  GpuDrawer(const GpuDrawer&) = delete;
  GpuDrawer& operator=(const GpuDrawer&) = delete;
  virtual ~GpuDrawer() = default;

  // What a content takes of the GPU at most, where it takes `decodedBytes` as it is decoded.
  virtual uint64_t residentBytes(uint64_t decodedBytes) const { return decodedBytes; }
  // Likewise of a resource, once for all contents that need it.
  virtual uint64_t residentBytesOfResource(uint64_t decodedBytes) const { return decodedBytes; }
  // What is made of the content's resources is shared by all contents that need them, and goes with the last: the
  // drawer finds what it has made of a resource, and each GpuContent keeps it.
  virtual std::unique_ptr<GpuContent> upload(const Content& content) = 0;

  // Queues a whole picture.
  virtual void draw(GpuPicture& picture, const SceneView<GpuContent>& view, const PictureRequest& request,
                    const DrawSettings& settings) = 0;

  // What the drawer may take of the GPU besides contents (as maps that are made when they are first seen). A drawer
  // that takes nothing of its own passes over it.
  virtual void setPoolBudget(uint64_t) {}
  // Whether the same view would look better if it were drawn again: something of the drawer's own is still on its way.
  virtual bool wantsAnotherFrame() const { return false; }
};

}  // namespace tessera
