// Draws contents of one representation on the GPU. It is the counterpart of CpuDrawer (render/drawer.h), against which
// its images are tested.
#pragma once

#include "render/drawer.h"
#include "render/vulkan/gpu_content.h"
#include "render/vulkan/gpu_frame.h"

namespace tessera {

// Each renderer owns one. All of its GPU work goes through one stream.
class GpuDrawer {
 public:
  GpuDrawer() = default;
  GpuDrawer(const GpuDrawer&) = delete;
  GpuDrawer& operator=(const GpuDrawer&) = delete;
  virtual ~GpuDrawer() = default;

  // Returns an upper bound of the GPU memory that a content takes. `decodedBytes`: the memory of the decoded content.
  virtual uint64_t residentBytes(uint64_t decodedBytes) const { return decodedBytes; }
  // Returns the same for a shared resource, which is counted once for all contents that use it.
  virtual uint64_t residentBytesOfResource(uint64_t decodedBytes) const { return decodedBytes; }
  // Turns a decoded content into one that upload() accepts, as far as that needs no GPU. Called by the threads that
  // read contents, several at a time.
  virtual std::unique_ptr<Content> prepare(std::unique_ptr<Content> content) const { return content; }
  // Uploads a content. What is built from its resources is shared by all contents that use them and is freed with the
  // last of these: the drawer looks up what it has built for a resource, and each GpuContent keeps a reference to it.
  virtual std::unique_ptr<GpuContent> upload(const Content& content) = 0;

  // The factor of SelectionSettings: larger where contents take long to load.
  virtual double hysteresis() const { return kUsualHysteresis; }

  // Queues the drawing of a whole image.
  virtual void draw(GpuFrame& frame, const SceneView<GpuContent>& view, const ViewRequest& request,
                    const DrawSettings& settings) = 0;

  // Returns whether draw() honours DrawnContent::share, so that levels of detail fade into each other.
  virtual bool crossFades() const { return false; }

  // Limits the GPU memory that the drawer may use besides contents, for example for maps that are built on first sight.
  // Drawers without such memory ignore it.
  virtual void setPoolBudget(uint64_t) {}
  // Returns whether the same view would look better if it were drawn again, because something of the drawer's own is
  // still being built.
  virtual bool wantsAnotherFrame() const { return false; }
};

}  // namespace tessera
