// The implementation of volk, which loads the Vulkan loader at run time.
#define VOLK_IMPLEMENTATION
#include <volk.h>
