#include "apps/viewer/window.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>

#include "base/error.h"

namespace tessera {
namespace {

Error failed(const std::string& what, const std::string& remedy) {
  const char* said = nullptr;
  glfwGetError(&said);
  return Error("window", what, said ? said : "no reason given", remedy);
}

}  // namespace

Window::Window(const std::string& title, int width, int height) {
  if (!glfwInit()) {
    throw failed("no screen",
                 "run it in a desktop session; elsewhere tessera render makes pictures, tessera serve shows scenes");
  }
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  window_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (!window_) {
    const Error error = failed("could not be made", "see that the desktop session is there");
    glfwTerminate();
    throw error;
  }
}

Window::~Window() {
  glfwDestroyWindow(window_);
  glfwTerminate();
}

VkSurfaceKHR Window::makeSurface(VkInstance instance) const {
  VkSurfaceKHR surface = VK_NULL_HANDLE;
  if (glfwCreateWindowSurface(instance, window_, nullptr, &surface) != VK_SUCCESS) {
    throw failed("has no surface to draw on", "update the graphics driver");
  }
  return surface;
}

bool Window::isClosing() const {
  return glfwWindowShouldClose(window_) != 0;
}

void Window::close() {
  glfwSetWindowShouldClose(window_, GLFW_TRUE);
}

VkExtent2D Window::pixels() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  return {static_cast<uint32_t>(width), static_cast<uint32_t>(height)};
}

float Window::contentScale() const {
  float x = 1, y = 1;
  glfwGetWindowContentScale(window_, &x, &y);
  return x;
}

void Window::listen(double seconds) {
  if (seconds > 0) {
    glfwWaitEventsTimeout(seconds);
  } else {
    glfwPollEvents();
  }
}

}  // namespace tessera
