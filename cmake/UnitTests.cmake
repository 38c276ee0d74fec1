# Precompiled headers of the tests: GoogleTest, Eigen, fmt and standard headers are most of what the compiler reads for a small
# test. They must be compiled with the flags of the tests, or the compiler does not use them: tests are executables (-fPIE), not
# parts of libraries. Only tests use them, so that product sources include what they use.
if(TESSERA_TESTS)
  file(GENERATE OUTPUT ${CMAKE_BINARY_DIR}/test_precompiled_headers.cpp CONTENT "")
  add_library(tessera_test_precompiled_headers OBJECT ${CMAKE_BINARY_DIR}/test_precompiled_headers.cpp)
  set_target_properties(tessera_test_precompiled_headers PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_link_libraries(tessera_test_precompiled_headers PRIVATE GTest::gtest Eigen3::Eigen fmt::fmt)
  target_compile_options(tessera_test_precompiled_headers PRIVATE -fPIE -O1)
  target_precompile_headers(tessera_test_precompiled_headers PRIVATE <gtest/gtest.h> <algorithm> <array> <chrono>
    <cmath> <filesystem> <fstream> <functional> <map> <memory> <optional> <random> <span> <sstream> <string>
    <string_view> <thread> <vector> <Eigen/Core> <Eigen/Geometry> <fmt/format.h>)
endif()

# Seconds that one CTest entry may take, and one process of an entry that shares its tests. Sanitizers make tests 5 to 15 times
# slower; a limit that only a quiet machine keeps would report a slow test as a failed one.
set(tessera_test_timeout 300)
set(tessera_test_process_timeout 1200)
if(TESSERA_SANITIZER)
  set(tessera_test_timeout 1800)
  set(tessera_test_process_timeout 3600)
endif()

# tessera_unit_tests(NAME SOURCES a_test.cpp ... LIBRARIES x ... [PREFIX p] [PROCESSES n] [SUITES s ...]): adds the binary
# tessera_NAME_test with one CTest entry p/... for each test; p defaults to NAME. With PROCESSES there are n entries that share its
# tests instead: for many tests that need the same fixture (a device and its pipelines, a capture), which each process then prepares
# once. SUITES are test suites with such a fixture of their own (a trained model): each is one entry p/SUITE. CTest does not report
# which tests of shared entries are skipped. Tests are compiled with -O1, which takes a tenth less time than -O2; most of what they
# run is in libraries, which are compiled as in the product.
function(tessera_unit_tests name)
  cmake_parse_arguments(ARG "" "PREFIX;PROCESSES" "SOURCES;LIBRARIES;SUITES" ${ARGN})
  if(NOT ARG_PREFIX)
    set(ARG_PREFIX ${name})
  endif()
  set(target tessera_${name}_test)
  add_executable(${target} ${ARG_SOURCES})
  target_link_libraries(${target} PRIVATE ${ARG_LIBRARIES} GTest::gtest_main)
  target_compile_options(${target} PRIVATE -O1)
  target_precompile_headers(${target} REUSE_FROM tessera_test_precompiled_headers)
  if(ARG_PROCESSES)
    math(EXPR last "${ARG_PROCESSES} - 1")
    foreach(index RANGE ${last})
      add_test(NAME ${ARG_PREFIX}/process_${index}_of_${ARG_PROCESSES} COMMAND ${target})
      set_tests_properties(${ARG_PREFIX}/process_${index}_of_${ARG_PROCESSES} PROPERTIES
        TIMEOUT ${tessera_test_process_timeout}
        ENVIRONMENT "GTEST_TOTAL_SHARDS=${ARG_PROCESSES};GTEST_SHARD_INDEX=${index}")
    endforeach()
    return()
  endif()
  set(others)  # GoogleTest's filter of all tests that are in no suite of SUITES
  if(ARG_SUITES)
    list(TRANSFORM ARG_SUITES APPEND ".*" OUTPUT_VARIABLE suites)
    list(JOIN suites ":" suites)
    set(others TEST_FILTER "-${suites}")
  endif()
  foreach(suite IN LISTS ARG_SUITES)
    # A suite that no longer exists must not pass as an entry without tests.
    add_test(NAME ${ARG_PREFIX}/${suite} COMMAND ${target} --gtest_filter=${suite}.*)
    set_tests_properties(${ARG_PREFIX}/${suite} PROPERTIES
      TIMEOUT ${tessera_test_process_timeout} FAIL_REGULAR_EXPRESSION "Running 0 tests")
  endforeach()
  gtest_discover_tests(${target} TEST_PREFIX "${ARG_PREFIX}/" DISCOVERY_MODE PRE_TEST ${others}
    PROPERTIES TIMEOUT ${tessera_test_timeout} SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
endfunction()
