# tessera_module(NAME
#   SOURCES a.cpp b.cpp ...     implementation files
#   USES base scene ...         other rooms (public)
#   LIBRARIES x y ...           third-party targets (public)
#   PRIVATE_LIBRARIES x y ...   third-party targets that no header of this room mentions
#   TESTS a_test.cpp ...)       unit tests; one binary tessera_NAME_test, one CTest entry a test)
#
# A room is a static library tessera_NAME; its headers are included as "NAME/file.h".
function(tessera_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LIBRARIES;PRIVATE_LIBRARIES;TESTS" ${ARGN})
  add_library(tessera_${name} STATIC ${ARG_SOURCES})
  target_include_directories(tessera_${name} PUBLIC ${CMAKE_SOURCE_DIR}/src)
  foreach(room IN LISTS ARG_USES)
    target_link_libraries(tessera_${name} PUBLIC tessera_${room})
  endforeach()
  target_link_libraries(tessera_${name} PUBLIC ${ARG_LIBRARIES} PRIVATE ${ARG_PRIVATE_LIBRARIES})
  if(TESSERA_TESTS AND ARG_TESTS)
    add_executable(tessera_${name}_test ${ARG_TESTS})
    target_link_libraries(tessera_${name}_test PRIVATE tessera_${name} ${ARG_PRIVATE_LIBRARIES} GTest::gtest_main)
    gtest_discover_tests(tessera_${name}_test TEST_PREFIX "${name}/" DISCOVERY_MODE PRE_TEST
      PROPERTIES TIMEOUT 300 SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
  endif()
endfunction()

# tessera_fuzzer(NAME source.cpp ROOM): a libFuzzer target for one decoder of outside bytes.
function(tessera_fuzzer name source room)
  if(TESSERA_FUZZERS)
    add_executable(fuzz_${name} ${source})
    target_link_libraries(fuzz_${name} PRIVATE tessera_${room})
    target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
  endif()
endfunction()
