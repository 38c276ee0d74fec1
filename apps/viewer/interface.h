// Dear ImGui in a window: forwards input to it and draws its triangles into the window's frames.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "apps/viewer/navigation.h"
#include "apps/viewer/window.h"
#include "gpu/presenter.h"
#include "gpu/screen_pipeline.h"

namespace tessera {

class Interface {
 public:
  // Only one may exist at a time, because Dear ImGui has global state. Keeps a reference to `window`.
  Interface(Window& window, const std::shared_ptr<const GpuContext>& context, VkRenderPass renderPass);
  ~Interface();
  Interface(const Interface&) = delete;
  Interface& operator=(const Interface&) = delete;

  // Begins the interface of the next frame; calls of ImGui may follow.
  void begin();
  // Returns the user's input outside of panels since the last frame.
  Moves moves() const;
  // Returns where the user double-clicked outside of panels: 0 to 1 to the right and down.
  std::optional<Vec2d> doubleClick() const;
  bool pressed(int key) const;  // a GLFW key; since the last frame, ignored while text is entered
  void end();                   // ends the interface of this frame
  void paint(GpuPresenter& presenter) const;

 private:
  Window& window_;
  std::vector<int> pressed_;
  GpuScreenPipeline pipeline_;
  GpuBuffer font_;
  uint32_t fontWidth_ = 0, fontHeight_ = 0;
};

}  // namespace tessera
