// A desktop window and its input.
#pragma once

#include <volk.h>

#include <string>
#include <utility>
#include <vector>

struct GLFWwindow;

namespace tessera {

class Window {
 public:
  // Throws Error if there is no screen.
  Window(const std::string& title, int width, int height);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  GLFWwindow* handle() const { return window_; }
  // Creates the surface into which the window's frames are presented; the caller owns it. Throws Error if the
  // driver cannot draw into the window.
  VkSurfaceKHR makeSurface(VkInstance instance) const;

  bool isClosing() const;
  void show();                 // the window is hidden at first
  VkExtent2D pixels() const;   // 0 × 0 while the window is hidden
  float contentScale() const;  // window pixels per pixel of an ordinary screen
  float unitsOfPixel() const;  // units of the desktop's window coordinates per pixel
  bool isHeld(int key) const;  // a GLFW key
  // Processes input events; waits at most `seconds` for one.
  void listen(double seconds);
  // Returns whether there was input, or the window must be redrawn, since the last call.
  bool takeTouched() { return std::exchange(touched_, false); }
  // Returns the GLFW keys that were pressed since the last call.
  std::vector<int> takePressed() { return std::exchange(pressed_, {}); }

 private:
  static void onKey(GLFWwindow* window, int key, int scanCode, int action, int modifiers);

  static Window& of(GLFWwindow* window);

  GLFWwindow* window_ = nullptr;
  std::vector<int> pressed_;
  bool touched_ = true;
};

}  // namespace tessera
