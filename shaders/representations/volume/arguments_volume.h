// The arguments of the kernels that render contents of `volume`, declared once for C++ and GLSL as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_REPRESENTATIONS_VOLUME_ARGUMENTS_VOLUME_H
#define TESSERA_SHADERS_REPRESENTATIONS_VOLUME_ARGUMENTS_VOLUME_H
#include "../../render/arguments_view.h"
TESSERA_BEGIN_ARGUMENTS

// A VolumePart.
struct VolumePartArguments {
  float centre[3];
  float texels;  // of a plane along an axis
  float scale[3];
  float voxels;  // along an axis
  float low[3];
  uint contracted;
  float high[3];
  uint unused;
  UintPointer macroblocks;  // indices of the stored macroblocks
  UintPointer voxelWords;   // [stored][9][9][9][2]
  UintPointer planeWords[3];
  UintPointer distances;  // bytes
};
TESSERA_SIZE(VolumePartArguments, 112);

#ifdef __cplusplus
using VolumePartsPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer VolumePartsPointer {
  VolumePartArguments values[];
};
#endif

// A VolumeContent and the box in which it is drawn.
struct DrawVolumeArguments {
  ViewArguments view;
  float low[3];
  uint partCount;
  float high[3];
  uint layerCount;
  float featureRange;
  float densityRange;
  float stepsPerTexel;
  uint isBackgroundBlock;
  VolumePartsPointer parts;
  LayersPointer layers;
  FloatPointer weights;
};
TESSERA_SIZE(DrawVolumeArguments, 240);

TESSERA_END_ARGUMENTS
#endif
