// The Khronos validation layers, which report incorrect use of Vulkan. They are off unless requested.
#pragma once

#include <volk.h>

namespace tessera {

inline const char* const kValidationLayer = "VK_LAYER_KHRONOS_validation";
inline const char* const kValidationExtension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;

// Returns whether the layers are installed; if not, logs a warning that names the package.
bool validationInstalled();

// Creates a messenger that logs the layers' errors and warnings as warnings. The caller must destroy it before the
// instance. Throws Error if it cannot be created.
VkDebugUtilsMessengerEXT createValidationMessenger(VkInstance instance);
void destroyValidationMessenger(VkInstance instance, VkDebugUtilsMessengerEXT messenger);

// Returns the number of errors and warnings that the layers have reported so far in this process.
int validationMessageCount();

}  // namespace tessera
