// What the host hands to the shaders that draw into windows: one truth, as in shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_WINDOW_ARGUMENTS_WINDOW_H
#define TESSERA_SHADERS_WINDOW_ARGUMENTS_WINDOW_H
#include "../compute/arguments.h"
TESSERA_BEGIN_ARGUMENTS

// A picture (RenderedView) over the whole window.
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

// Triangles of Dear ImGui: one draw command.
struct InterfaceArguments {
  UintPointer vertices;  // ImDrawVert: position, place in the font's picture, colour; five words each
  UintPointer indices;   // two in a word
  UintPointer font;      // opacities, four in a word
  uint firstIndex;
  uint firstVertex;
  uint fontWidth;  // texels
  uint fontHeight;
  float low[2];    // of what is shown, ImGui's units
  float scale[2];  // from those to Vulkan's
};
TESSERA_SIZE(InterfaceArguments, 56);

TESSERA_END_ARGUMENTS
#endif
