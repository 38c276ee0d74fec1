# tessera_shader(TARGET source.comp [VARIANT name] [DEFINES A B ...])
#
# Compiles GLSL to SPIR-V when TARGET is built, as the header "shaders/<source>[_<variant>].h", which holds the words as
# `const uint32_t k<Source><Variant>Spirv[]` (snake_case becomes PascalCase). Includes are followed.
function(tessera_shader target source)
  cmake_parse_arguments(ARG "" "VARIANT" "DEFINES" ${ARGN})
  get_filename_component(name ${source} NAME_WE)
  if(ARG_VARIANT)
    string(APPEND name _${ARG_VARIANT})
  endif()
  set(symbol k)
  string(REPLACE "_" ";" words ${name})
  foreach(word IN LISTS words)
    string(SUBSTRING ${word} 0 1 first)
    string(SUBSTRING ${word} 1 -1 rest)
    string(TOUPPER ${first} first)
    string(APPEND symbol ${first}${rest})
  endforeach()
  list(TRANSFORM ARG_DEFINES PREPEND -D)

  set(folder ${CMAKE_CURRENT_BINARY_DIR}/generated)
  set(header ${folder}/shaders/${name}.h)
  file(MAKE_DIRECTORY ${folder}/shaders)
  add_custom_command(
    OUTPUT ${header}
    COMMAND ${GLSLANG_VALIDATOR} -V --quiet --target-env vulkan1.2 ${ARG_DEFINES} --vn ${symbol}Spirv
            --depfile ${header}.d -o ${header} ${CMAKE_SOURCE_DIR}/shaders/${source}
    MAIN_DEPENDENCY ${CMAKE_SOURCE_DIR}/shaders/${source}
    DEPFILE ${header}.d
    COMMENT "Compiling shader ${name}"
    VERBATIM)
  target_sources(${target} PRIVATE ${header})
  target_include_directories(${target} PRIVATE ${folder})
endfunction()
