// Arguments of the hash grid (src/compute/hash_grid.h).
#ifndef TESSERA_SHADERS_COMPUTE_ARGUMENTS_HASH_GRID_H
#define TESSERA_SHADERS_COMPUTE_ARGUMENTS_HASH_GRID_H
#include "arguments.h"
TESSERA_BEGIN_ARGUMENTS

#define TESSERA_MAX_LEVELS 128

struct LevelArguments {
  float scale;
  uint resolution;
  uint entries;
  uint hashed;
  uint firstEntry;
  uint unused;
};
TESSERA_SIZE(LevelArguments, 24);

struct HashGridForwardArguments {
  CountArguments samples;
  FloatPointer positions;
  FloatPointer table;
  MatrixArguments encoded;
  LevelArguments levels[TESSERA_MAX_LEVELS];
};
TESSERA_SIZE(HashGridForwardArguments, 64 + 24 * TESSERA_MAX_LEVELS);

struct HashGridBackwardArguments {
  CountArguments samples;
  FloatPointer positions;
  FloatPointer table;
  SumPointer tableGradients;
  FloatPointer positionGradients;
  MatrixArguments encodedGradients;
  uint levelCount;
  uint unused;
  LevelArguments levels[TESSERA_MAX_LEVELS];
};
TESSERA_SIZE(HashGridBackwardArguments, 88 + 24 * TESSERA_MAX_LEVELS);

TESSERA_END_ARGUMENTS
#endif
