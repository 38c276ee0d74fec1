// A window of the desktop, and what people do in it.
#pragma once

#include <volk.h>

#include <string>

struct GLFWwindow;

namespace tessera {

class Window {
 public:
  // Throws Error where there is no screen.
  Window(const std::string& title, int width, int height);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  GLFWwindow* handle() const { return window_; }
  // Of the pictures that the window shows. Whoever asks owns it. Throws Error.
  VkSurfaceKHR makeSurface(VkInstance instance) const;

  bool isClosing() const;
  void close();
  VkExtent2D pixels() const;   // 0 × 0 while it is hidden
  float contentScale() const;  // pixels of what is one pixel on an ordinary screen
  // Takes in what people did; waits for something to happen, at most so long.
  void listen(double seconds);

 private:
  GLFWwindow* window_ = nullptr;
};

}  // namespace tessera
