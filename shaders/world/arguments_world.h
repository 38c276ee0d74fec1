// The arguments of the shaders that draw worlds of several scenes and models, declared once for C++ and GLSL as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_WORLD_ARGUMENTS_WORLD_H
#define TESSERA_SHADERS_WORLD_ARGUMENTS_WORLD_H
#include "../compute/arguments.h"
TESSERA_BEGIN_ARGUMENTS

// A ModelMaterial.
struct ModelMaterialArguments {
  float baseColour[3];
  float opacity;
  float emission[3];
  float cutoff;
  float metalness;
  float roughness;
  uint texture;          // number + 1; 0: none
  uint surfaceTexture;   // likewise
  uint emissionTexture;  // likewise
  uint isDoubleSided;
  uint isLit;
  uint unused;
};
TESSERA_SIZE(ModelMaterialArguments, 64);

struct ModelTextureArguments {
  UintPointer texels;  // of all levels, the largest first: red, green, blue and opacity from the lowest byte on
  uint width;
  uint height;
  uint levels;
  uint unused;
};
TESSERA_SIZE(ModelTextureArguments, 24);

#ifdef __cplusplus
using ModelMaterialsPointer = uint64_t;
using ModelTexturesPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer ModelMaterialsPointer {
  ModelMaterialArguments values[];
};
layout(buffer_reference, std430, buffer_reference_align = 8) buffer ModelTexturesPointer {
  ModelTextureArguments values[];
};
#endif

// A model in a view. All is relative to the eye, so that single precision suffices.
struct DrawModelArguments {
  float worldFromModel[9];   // row-major, with the scale
  float shift[3];            // of the model's origin from the eye, along the axes of the world
  float normalFromModel[9];  // turns normals into the axes of the world
  float cameraFromWorld[9];
  float focal[2];  // pixels
  float centre[2];
  float near;  // along the axis, world units
  uint width;
  uint height;
  uint unused;
  FloatPointer vertices;  // [vertices][10]: ModelVertex
  UintPointer corners;
  ModelMaterialsPointer materials;
  ModelTexturesPointer textures;
};
TESSERA_SIZE(DrawModelArguments, 184);

// The image of a world.
struct WorldImageArguments {
  FloatPointer colour;   // [pixels][3], premultiplied
  FloatPointer opacity;  // [pixels]
  FloatPointer depth;    // [pixels]: z-depth of the nearest surface, world units; infinite where there is none
  uint pixels;
  uint unused;
};
TESSERA_SIZE(WorldImageArguments, 32);

struct BeginWorldArguments {
  WorldImageArguments image;
  UintPointer modelColours;  // [pixels], four bytes each; optional
  FloatPointer modelDepths;  // [pixels], 0 where there is no model; optional
};
TESSERA_SIZE(BeginWorldArguments, 48);

// A scene in front of what the image holds so far.
struct AddSceneArguments {
  WorldImageArguments image;
  FloatPointer colour;
  FloatPointer opacity;
  FloatPointer surface;
};
TESSERA_SIZE(AddSceneArguments, 56);

TESSERA_END_ARGUMENTS
#endif
