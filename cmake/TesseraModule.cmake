# tessera_module(NAME
#   SOURCES a.cpp b.cpp ...     implementation files
#   USES base scene ...         other modules (public)
#   LIBRARIES x y ...           third-party targets (public)
#   PRIVATE_LIBRARIES x y ...   third-party targets that no header of this module mentions
#   TESTS a_test.cpp ...        unit tests; one binary tessera_NAME_test, one CTest entry for each test
#   TEST_PROCESSES n)           instead, n entries that share the tests (tessera_unit_tests)
#
# A module is a static library tessera_NAME; its headers are included as "NAME/file.h". A header-only module has no SOURCES.
function(tessera_module name)
  cmake_parse_arguments(ARG "" "TEST_PROCESSES" "SOURCES;USES;LIBRARIES;PRIVATE_LIBRARIES;TESTS" ${ARGN})
  list(TRANSFORM ARG_USES PREPEND tessera_)
  if(ARG_SOURCES)
    add_library(tessera_${name} STATIC ${ARG_SOURCES})
    target_include_directories(tessera_${name} PUBLIC ${CMAKE_SOURCE_DIR}/src)
    target_link_libraries(tessera_${name} PUBLIC ${ARG_USES} ${ARG_LIBRARIES} PRIVATE ${ARG_PRIVATE_LIBRARIES})
  else()
    add_library(tessera_${name} INTERFACE)
    target_include_directories(tessera_${name} INTERFACE ${CMAKE_SOURCE_DIR}/src)
    target_link_libraries(tessera_${name} INTERFACE ${ARG_USES} ${ARG_LIBRARIES})
  endif()
  if(TESSERA_TESTS AND ARG_TESTS)
    tessera_unit_tests(${name} SOURCES ${ARG_TESTS} LIBRARIES tessera_${name} ${ARG_PRIVATE_LIBRARIES}
      PROCESSES ${ARG_TEST_PROCESSES})
  endif()
endfunction()

# tessera_simd_kernels(TARGET): for the Highway kernels of a library that chooses an instruction set at run time. These are compiled
# with -O3, which is faster for them.
function(tessera_simd_kernels target)
  target_compile_options(${target} PRIVATE -O3)
  # A source that Highway compiles once for each instruction set includes itself, so it cannot be part of a unity build.
  set_target_properties(${target} PROPERTIES UNITY_BUILD OFF)
  tessera_simd_targets(${target})
endfunction()

# tessera_simd_targets(TARGET): links Highway with the instruction sets of this project. Also for tests that run a library's kernels
# with each set in turn: they include what was compiled for each set, and must see the same sets.
function(tessera_simd_targets target)
  target_link_libraries(${target} PRIVATE PkgConfig::HWY)
  # Targets that speed up these kernels no further than AVX3 would only double the build time.
  target_compile_definitions(${target} PRIVATE "HWY_DISABLED_TARGETS=(HWY_AVX3_DL)")
  if(TESSERA_FUZZERS)  # which run decoders: the oldest set will do
    target_compile_definitions(${target} PRIVATE HWY_COMPILE_ONLY_STATIC)
  endif()
endfunction()

# tessera_representation(NAME
#   CONTENT a.cpp ...              tessera_NAME_content: a content in memory, its reader, writer and rules
#   CPU a.cpp ...                  tessera_NAME_cpu: rendering on the CPU, with kernels for several instruction sets
#   VULKAN a.cpp ...               tessera_NAME_vulkan: rendering on the GPU; only in builds with Vulkan
#   TRAIN a.cpp ...                tessera_NAME_train: settings, model, training step and baking
#   CONTENT_USES base scene ...    other modules (public); likewise CPU_USES, VULKAN_USES, TRAIN_USES
#   CONTENT_LIBRARIES x ...        third-party targets that no header of this part mentions; likewise for the other parts
#   TESTS a_test.cpp ...           unit tests of all parts, in one binary tessera_representation_NAME_test to save link time
#   VULKAN_TESTS b_test.cpp ...    those of them that need Vulkan
#   TEST_SUITES s ...              suites of these tests with a fixture that takes long, one CTest entry each (tessera_unit_tests)
#   TEST_USES render ...           other modules that tests use
#   TEST_LIBRARIES x ...)          third-party targets that they use
#
# Each part of a representation is a library of its own, so that programs that only render link no trainer. CPU, VULKAN and TRAIN
# use CONTENT. A part without files is not created: `field` has no content. File names are relative to the caller's folder
# (content/reader.cpp). VULKAN is the target of the shaders: tessera_shader(tessera_NAME_vulkan ...).
function(tessera_representation name)
  set(parts CONTENT CPU VULKAN TRAIN)
  set(lists ${parts} TESTS VULKAN_TESTS TEST_SUITES TEST_USES TEST_LIBRARIES)
  foreach(part IN LISTS parts)
    list(APPEND lists ${part}_USES ${part}_LIBRARIES)
  endforeach()
  cmake_parse_arguments(ARG "" "" "${lists}" ${ARGN})
  if(ARG_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "tessera_representation(${name}) does not know ${ARG_UNPARSED_ARGUMENTS}")
  endif()
  if(NOT TESSERA_VULKAN)
    set(ARG_VULKAN)
    set(ARG_VULKAN_TESTS)
  endif()

  set(libraries)
  foreach(part IN LISTS parts)
    if(NOT ARG_${part})
      continue()
    endif()
    string(TOLOWER ${part} suffix)
    set(uses ${ARG_${part}_USES})
    if(NOT part STREQUAL CONTENT AND ARG_CONTENT)
      list(PREPEND uses ${name}_content)
    endif()
    tessera_module(${name}_${suffix} SOURCES ${ARG_${part}} USES ${uses} PRIVATE_LIBRARIES ${ARG_${part}_LIBRARIES})
    list(APPEND libraries tessera_${name}_${suffix})
  endforeach()
  if(ARG_CPU)
    tessera_simd_kernels(tessera_${name}_cpu)
  endif()

  if(TESSERA_TESTS AND (ARG_TESTS OR ARG_VULKAN_TESTS))
    list(TRANSFORM ARG_TEST_USES PREPEND tessera_)
    tessera_unit_tests(representation_${name} SOURCES ${ARG_TESTS} ${ARG_VULKAN_TESTS}
      LIBRARIES ${libraries} ${ARG_TEST_USES} ${ARG_TEST_LIBRARIES} SUITES ${ARG_TEST_SUITES})
    if(ARG_CPU)
      tessera_simd_targets(tessera_representation_${name}_test)
    endif()
  endif()
endfunction()

# tessera_fuzzer(NAME source.cpp MODULE): a libFuzzer target for one decoder of untrusted bytes.
function(tessera_fuzzer name source module)
  if(TESSERA_FUZZERS)
    add_executable(fuzz_${name} ${source})
    target_link_libraries(fuzz_${name} PRIVATE tessera_${module})
    target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
  endif()
endfunction()
