// The arguments of the shaders that draw into windows, declared once for C++ and GLSL as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_WINDOW_ARGUMENTS_WINDOW_H
#define TESSERA_SHADERS_WINDOW_ARGUMENTS_WINDOW_H
#include "../compute/arguments.h"
TESSERA_BEGIN_ARGUMENTS

// An image (RenderedView) that fills the whole window.
struct ShowPictureArguments {
  FloatPointer colour;   // [height][width][3], premultiplied
  FloatPointer opacity;  // [height][width]
  uint width;
  uint height;
  float windowWidth;  // pixels
  float windowHeight;
  float background[3];
  uint unused;
};
TESSERA_SIZE(ShowPictureArguments, 48);

// The triangles of one draw command of Dear ImGui.
struct InterfaceArguments {
  UintPointer vertices;  // ImDrawVert: position, font texture coordinates, colour; five words each
  UintPointer indices;   // two per word
  UintPointer font;      // opacities, four per word
  uint firstIndex;
  uint firstVertex;
  uint fontWidth;  // texels
  uint fontHeight;
  float low[2];    // upper left corner of the display, ImGui's units
  float scale[2];  // from ImGui's units to Vulkan's clip space
};
TESSERA_SIZE(InterfaceArguments, 56);

TESSERA_END_ARGUMENTS
#endif
