// The arguments of the kernels that render contents of `hash`, declared once for C++ and GLSL as in
// shaders/compute/arguments.h.
#ifndef TESSERA_SHADERS_REPRESENTATIONS_HASH_ARGUMENTS_HASH_H
#define TESSERA_SHADERS_REPRESENTATIONS_HASH_ARGUMENTS_HASH_H
#include "../../render/arguments_view.h"
TESSERA_BEGIN_ARGUMENTS

// The maximum number of tables of a HashPart.
#define TESSERA_MAX_TABLES 8

struct HashPartArguments {
  float centre[3];
  float texels;  // finest cells along an axis
  float scale[3];
  float lattice;  // corners along an axis
  float low[3];
  uint contracted;
  float high[3];
  int ratio;                // 0, 1, 2: coarse cells are 1, 2 or 4 finest ones wide
  UintPointer macroblocks;  // indices of the stored macroblocks
  UintPointer cornerWords;  // [stored][9][9][9][columns / 4]
  UintPointer coarse;
  UintPointer fine;
  UintPointer tables[TESSERA_MAX_TABLES];  // [entries][2]
  uint firstVector;                        // index in `vectors`; see gpu_hash_content.cpp
  uint unused;
};
TESSERA_SIZE(HashPartArguments, 168);

struct NetworkArguments {
  Bits64 layers;   // LayersPointer
  Bits64 weights;  // FloatPointer
  uint layerCount;
  uint unused;
};
TESSERA_SIZE(NetworkArguments, 24);

#ifdef __cplusplus
using HashPartsPointer = uint64_t;
using NetworksPointer = uint64_t;
using VectorsPointer = uint64_t;
#else
layout(buffer_reference, std430, buffer_reference_align = 8) buffer HashPartsPointer {
  HashPartArguments values[];
};
layout(buffer_reference, std430, buffer_reference_align = 8) buffer NetworksPointer {
  NetworkArguments values[];
};
layout(buffer_reference, std430, buffer_reference_align = 16) buffer VectorsPointer {
  vec4 values[];
};
#endif

// A HashContent and the box in which it is drawn.
struct DrawHashArguments {
  ViewArguments view;
  float low[3];
  uint partCount;
  float high[3];
  uint isBackgroundBlock;
  float stepLength;
  uint columns;
  uint network;  // index among the networks of the view
  uint unused;
  float levelWeights[2 * TESSERA_MAX_TABLES];  // per level: of density and of all else, if they do not vary
  HashPartsPointer parts;
  VectorsPointer vectors;
};
TESSERA_SIZE(DrawHashArguments, 296);

// The networks that turn the sums of all contents into colours.
struct EndHashArguments {
  ViewArguments view;
  NetworksPointer networks;
  uint networkCount;
  uint backgroundContent;  // the network of rays that meet no content
  uint hasLearnedBackground;
  uint unused;
};
TESSERA_SIZE(EndHashArguments, 192);

TESSERA_END_ARGUMENTS
#endif
