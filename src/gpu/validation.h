// Khronos' validation layers: they say what we do wrong with Vulkan. Off unless asked for.
#pragma once

#include <volk.h>

namespace tessera {

inline const char* const kValidationLayer = "VK_LAYER_KHRONOS_validation";
inline const char* const kValidationExtension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;

// Warns, naming the package, where they are not.
bool validationInstalled();

// Reports warnings and errors as log warnings.
VkDebugUtilsMessengerEXT createValidationMessenger(VkInstance instance);
void destroyValidationMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger);

// Errors and warnings that they reported so far in this process.
int validationMessageCount();

}  // namespace tessera
