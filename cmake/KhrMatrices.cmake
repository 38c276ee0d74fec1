# TESSERA_KHR_MATRICES: whether the shader compiler and Vulkan's headers support VK_KHR_cooperative_matrix (glslang 14, headers
# 1.3.255). Debian 12's support only VK_NV_cooperative_matrix.
include(CheckCXXSourceCompiles)
set(CMAKE_REQUIRED_INCLUDES ${VOLK_INCLUDE_DIR})
check_cxx_source_compiles("
  #include <volk.h>
  int main() { return vkGetPhysicalDeviceCooperativeMatrixPropertiesKHR != nullptr && VK_COMPONENT_TYPE_FLOAT16_KHR; }
  #define VOLK_IMPLEMENTATION
  #include <volk.h>
" TESSERA_HEADERS_KNOW_KHR_MATRICES)
unset(CMAKE_REQUIRED_INCLUDES)
set(khr_shader ${CMAKE_BINARY_DIR}/CMakeFiles/khr_matrices.comp)
file(WRITE ${khr_shader} "#version 460
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_cooperative_matrix : require
void main() { coopmat<float, gl_ScopeSubgroup, 16, 16, gl_MatrixUseAccumulator> m; }
")
execute_process(COMMAND ${GLSLANG_VALIDATOR} -V --target-env vulkan1.2 -o ${khr_shader}.spv ${khr_shader}
  RESULT_VARIABLE khr_failed OUTPUT_QUIET ERROR_QUIET)
set(TESSERA_KHR_MATRICES OFF)
if(TESSERA_HEADERS_KNOW_KHR_MATRICES AND khr_failed EQUAL 0)
  set(TESSERA_KHR_MATRICES ON)
  add_compile_definitions(TESSERA_KHR_MATRICES)
endif()
message(STATUS "VK_KHR_cooperative_matrix: ${TESSERA_KHR_MATRICES}")
