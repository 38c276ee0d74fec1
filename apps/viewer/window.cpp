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
                 "run it in a desktop session; elsewhere tessera render writes images, tessera serve shows scenes");
  }
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  glfwWindowHint(GLFW_VISIBLE, GLFW_FALSE);
  window_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (!window_) {
    const Error error = failed("could not be made", "check that a desktop session is running");
    glfwTerminate();
    throw error;
  }
  glfwSetWindowUserPointer(window_, this);
  glfwSetKeyCallback(window_, onKey);
  glfwSetCharCallback(window_, [](GLFWwindow* window, unsigned) { of(window).touched_ = true; });
  glfwSetMouseButtonCallback(window_, [](GLFWwindow* window, int, int, int) { of(window).touched_ = true; });
  glfwSetScrollCallback(window_, [](GLFWwindow* window, double, double) { of(window).touched_ = true; });
  glfwSetCursorPosCallback(window_, [](GLFWwindow* window, double, double) { of(window).touched_ = true; });
  glfwSetWindowRefreshCallback(window_, [](GLFWwindow* window) { of(window).touched_ = true; });
  glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* window, int, int) { of(window).touched_ = true; });
}

Window::~Window() {
  glfwDestroyWindow(window_);
  glfwTerminate();
}

Window& Window::of(GLFWwindow* window) {
  return *static_cast<Window*>(glfwGetWindowUserPointer(window));
}

// Records key presses, because Dear ImGui polls the key state once per frame and a frame may take longer than a press.
void Window::onKey(GLFWwindow* window, int key, int, int action, int modifiers) {
  of(window).touched_ = true;
  constexpr int kOthers = GLFW_MOD_CONTROL | GLFW_MOD_ALT | GLFW_MOD_SUPER;
  if (action != GLFW_PRESS || (modifiers & kOthers) != 0) return;
  of(window).pressed_.push_back(key);
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

void Window::show() {
  glfwShowWindow(window_);
}

bool Window::isHeld(int key) const {
  return glfwGetKey(window_, key) == GLFW_PRESS;
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

float Window::unitsOfPixel() const {
  int width = 0, height = 0;
  glfwGetWindowSize(window_, &width, &height);
  const uint32_t inPixels = pixels().width;
  return inPixels > 0 && width > 0 ? static_cast<float>(width) / static_cast<float>(inPixels) : 1;
}

void Window::listen(double seconds) {
  if (seconds > 0) {
    glfwWaitEventsTimeout(seconds);
  } else {
    glfwPollEvents();
  }
}

}  // namespace tessera
