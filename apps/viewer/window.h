// A window of the desktop, and what people do in it.
#pragma once

#include <volk.h>

#include <string>
#include <utility>
#include <vector>

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
  void show();                 // it is hidden at first
  VkExtent2D pixels() const;   // 0 × 0 while it is hidden
  float contentScale() const;  // pixels of what is one pixel on an ordinary screen
  float unitsOfPixel() const;  // the desktop's, in which it speaks of places in windows
  bool isHeld(int key) const;  // GLFW's number
  // Takes in what people did; waits for something to happen, at most so long.
  void listen(double seconds);
  // Whether people did anything, or the window has to be drawn anew: since the last time.
  bool takeTouched() { return std::exchange(touched_, false); }
  // Keys that went down, GLFW's numbers: since the last time.
  std::vector<int> takePressed() { return std::exchange(pressed_, {}); }

 private:
  static void onKey(GLFWwindow* window, int key, int scanCode, int action, int modifiers);

  static Window& of(GLFWwindow* window);

  GLFWwindow* window_ = nullptr;
  std::vector<int> pressed_;
  bool touched_ = true;
};

}  // namespace tessera
