# What nearly every test includes, parsed once: GoogleTest is most of what a compiler reads of a small test. Programs are
# compiled otherwise than libraries (-fPIE), and the compiler takes what was parsed only where the flags are the same.
# Only for tests: sources of the product have to include what they use.
if(TESSERA_TESTS)
  file(GENERATE OUTPUT ${CMAKE_BINARY_DIR}/parsed_once.cpp CONTENT "")
  add_library(tessera_parsed_once OBJECT ${CMAKE_BINARY_DIR}/parsed_once.cpp)
  set_target_properties(tessera_parsed_once PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_link_libraries(tessera_parsed_once PRIVATE GTest::gtest)
  target_compile_options(tessera_parsed_once PRIVATE -fPIE -O1)
  target_precompile_headers(tessera_parsed_once PRIVATE <gtest/gtest.h> <algorithm> <array> <chrono> <cmath> <filesystem>
    <fstream> <functional> <map> <memory> <optional> <random> <span> <sstream> <string> <string_view> <thread> <vector>)
endif()

# tessera_unit_tests(NAME SOURCES a_test.cpp ... LIBRARIES x ... [PREFIX p]): the binary tessera_NAME_test, one CTest
# entry p/... a test; p is NAME unless told. Tests are compiled with -O1, which is a tenth faster than -O2: what takes
# time when they run is in libraries.
function(tessera_unit_tests name)
  cmake_parse_arguments(ARG "" "PREFIX" "SOURCES;LIBRARIES" ${ARGN})
  if(NOT ARG_PREFIX)
    set(ARG_PREFIX ${name})
  endif()
  set(target tessera_${name}_test)
  add_executable(${target} ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES} GTest::gtest_main)
  target_compile_options(${target} PRIVATE -O1)
  target_precompile_headers(${target} REUSE_FROM tessera_parsed_once)
  gtest_discover_tests(${target} TEST_PREFIX "${ARG_PREFIX}/" DISCOVERY_MODE PRE_TEST
    PROPERTIES TIMEOUT 300 SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
endfunction()
