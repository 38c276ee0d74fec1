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
};
TESSERA_SIZE(ViewArguments, 144);

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
