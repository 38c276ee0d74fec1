// volk's own code, which finds the Vulkan loader at run time.
#define VOLK_IMPLEMENTATION
#include <volk.h>
