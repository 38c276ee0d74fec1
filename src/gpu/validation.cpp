#include "gpu/validation.h"

#include <atomic>
#include <cstring>
#include <vector>

#include "base/log.h"
#include "gpu/call.h"

namespace tessera {

namespace {

std::atomic<int> messageCount = 0;

VKAPI_ATTR VkBool32 VKAPI_CALL report(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                      const VkDebugUtilsMessengerCallbackDataEXT* data, void*) {
  ++messageCount;
  warn("vulkan validation: {}", data->pMessage);
  return VK_FALSE;
}

}  // namespace

bool validationInstalled() {
  uint32_t count = 0;
  checkVulkan(vkEnumerateInstanceLayerProperties(&count, nullptr), "vkEnumerateInstanceLayerProperties");
  std::vector<VkLayerProperties> layers(count);
  checkVulkan(vkEnumerateInstanceLayerProperties(&count, layers.data()), "vkEnumerateInstanceLayerProperties");
  for (const VkLayerProperties& layer : layers) {
    if (std::strcmp(layer.layerName, kValidationLayer) == 0) return true;
  }
  warn("Vulkan validation is requested, but the layers are not installed; the package is vulkan-validationlayers");
  return false;
}

VkDebugUtilsMessengerEXT createValidationMessenger(VkInstance instance) {
  auto info = vulkanStruct<VkDebugUtilsMessengerCreateInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
  info.messageSeverity =
      VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT;
  info.pfnUserCallback = report;
  const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
      vkGetInstanceProcAddr(instance, "vkCreateDebugUtilsMessengerEXT"));
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
  checkVulkan(create(instance, &info, nullptr, &messenger), "vkCreateDebugUtilsMessengerEXT");
  return messenger;
}

void destroyValidationMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger) {
  const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
      vkGetInstanceProcAddr(instance, "vkDestroyDebugUtilsMessengerEXT"));
  destroy(instance, messenger, nullptr);
}

int validationMessageCount() {
  return messageCount;
}

}  // namespace tessera
