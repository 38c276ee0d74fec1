// The arguments of the kernels that render scenes of any representation, declared once for C++ and GLSL as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_RENDER_ARGUMENTS_VIEW_H
#define TESSERA_SHADERS_RENDER_ARGUMENTS_VIEW_H
#include "../compute/arguments.h"
TESSERA_BEGIN_ARGUMENTS

// The view of a camera in a scene (src/render/tile_frame.h), in scene units, and its output.
struct ViewArguments {
  float sceneFromCamera[9];  // rotation, row-major
  float origin[3];
  float low[3];  // the scene's box
  float high[3];
  float near;
  float scale;  // world units per scene unit
  float minTransmittance;
  uint width;
  uint height;
  uint numbersOfPixel;
  FloatPointer directions;   // [pixels][3], in camera axes; zero beyond the lens
  FloatPointer opaqueDepth;  // optional, [pixels], world units
  FloatPointer pixels;       // [pixels][numbersOfPixel]: sums along the rays; see begin_view.comp
  FloatPointer colour;       // [pixels][3]
  FloatPointer opacity;
  FloatPointer depth;
  FloatPointer surface;  // optional, [pixels]: z-depth of the surface, world units; infinite where there is none
  FloatPointer boxes;    // [boxCount][3][4]: each matrix maps scene units to a hidden box, from -0.5 to 0.5 along each axis
  uint boxCount;         // boxes in which nothing of the background block is drawn
  uint boxesOfAll;       // the first of them, in which nothing of other contents is drawn either
};
TESSERA_SIZE(ViewArguments, 168);

// DenseLayer; the biases follow the weights.
struct LayerArguments {
  uint inputs;
  uint outputs;
  uint firstWeight;
  uint unused;
};
TESSERA_SIZE(LayerArguments, 16);

#ifdef __cplusplus
using LayersPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer LayersPointer {
  LayerArguments values[];
};
#endif

TESSERA_END_ARGUMENTS
#endif
