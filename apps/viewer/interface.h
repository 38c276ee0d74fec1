// Dear ImGui in a window: its input, and its triangles in the window's pictures.
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
  // One at a time: Dear ImGui is a global thing. Keeps a reference to `window`.
  Interface(Window& window, const std::shared_ptr<const GpuContext>& context, VkRenderPass renderPass);
  ~Interface();
  Interface(const Interface&) = delete;
  Interface& operator=(const Interface&) = delete;

  // Begins what is shown with the next picture: calls of ImGui may follow.
  void begin();
  // What people did outside of panels since the last picture.
  Moves moves() const;
  // Where somebody clicked twice outside of panels: 0 to 1 to the right and down.
  std::optional<Vec2d> doubleClick() const;
  bool pressed(int key) const;  // GLFW's number; since the last picture, not while text is entered
  void end();                   // of what is shown
  void paint(GpuPresenter& presenter) const;

 private:
  Window& window_;
  std::vector<int> pressed_;
  GpuScreenPipeline pipeline_;
  GpuBuffer font_;
  uint32_t fontWidth_ = 0, fontHeight_ = 0;
};

}  // namespace tessera
