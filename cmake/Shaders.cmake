# tessera_shader(TARGET source.comp [VARIANT name] [DEFINES A B ...])
#
# Compiles GLSL to SPIR-V when TARGET is built, as the header "shaders/<source>[_<variant>].h", which holds the words as `const
# uint32_t k<Source><Variant>Spirv[]` (snake_case becomes PascalCase). Includes are tracked as dependencies. The folder and the
# stage are not part of the name: two shaders of one CMakeLists.txt that would write the same header (render/draw.comp and
# window/draw.frag) stop the configuration.
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
  set(from "${source} ${ARG_VARIANT}")
  get_property(other GLOBAL PROPERTY tessera_shader_of_${header})
  if(other AND NOT other STREQUAL from)
    message(FATAL_ERROR "The shaders ${other} and ${from} would both become shaders/${name}.h: rename one")
  endif()
  set_property(GLOBAL PROPERTY tessera_shader_of_${header} ${from})
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
