// What the host hands to the kernels that draw scenes: one truth, read by C++ and GLSL alike, as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_RENDER_ARGUMENTS_DRAW_H
#define TESSERA_SHADERS_RENDER_ARGUMENTS_DRAW_H
#include "../compute/arguments.h"
TESSERA_BEGIN_ARGUMENTS

// A camera in a scene (src/render/tile_frame.h), scene units.
struct ViewArguments {
  float sceneFromCamera[9];  // rotation, row-major
  float origin[3];
  float low[3];  // the scene's box
  float high[3];
  float near;
  float scale;  // world units of one scene unit
  float minTransmittance;
  uint width;
  uint height;
  uint unused;
  FloatPointer directions;   // [pixels][3], in camera axes; zero beyond the lens
  FloatPointer opaqueDepth;  // optional, [pixels], world units
  FloatPointer pixels;       // [pixels][5]: premultiplied colour, transmittance, depth along the ray
  FloatPointer colour;       // [pixels][3]
  FloatPointer opacity;
  FloatPointer depth;
};
TESSERA_SIZE(ViewArguments, 144);

// VolumePart.
struct VolumePartArguments {
  float centre[3];
  float texels;  // of a plane along an axis
  float scale[3];
  float voxels;  // along an axis
  float low[3];
  uint contracted;
  float high[3];
  uint unused;
  UintPointer macroblocks;  // numbers of those stored
  UintPointer voxelWords;   // [stored][9][9][9][2]
  UintPointer planeWords[3];
  UintPointer distances;    // bytes
};
TESSERA_SIZE(VolumePartArguments, 112);

// DenseLayer: biases behind the weights.
struct LayerArguments {
  uint inputs;
  uint outputs;
  uint firstWeight;
  uint unused;
};
TESSERA_SIZE(LayerArguments, 16);

#ifdef __cplusplus
using VolumePartsPointer = uint64_t;
using LayersPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer VolumePartsPointer { VolumePartArguments values[]; };
layout(buffer_reference, std430, buffer_reference_align = 8) buffer LayersPointer { LayerArguments values[]; };
#endif

// VolumeContent, and where of it something is drawn.
struct DrawVolumeArguments {
  ViewArguments view;
  float low[3];
  uint partCount;
  float high[3];
  uint layerCount;
  float featureRange;
  float densityRange;
  float stepsPerTexel;
  uint isSurround;
  VolumePartsPointer parts;
  LayersPointer layers;
  FloatPointer weights;
};
TESSERA_SIZE(DrawVolumeArguments, 216);

TESSERA_END_ARGUMENTS
#endif
