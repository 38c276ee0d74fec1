// Computes a layer for a block of samples per workgroup: with cooperative matrices (TESSERA_MATRICES) or without.
#ifdef TESSERA_MATRICES
#include "mlp_matrices.glsl"
#else
#include "mlp_tile.glsl"
#endif

// Loops over the first sample of every block of samples [begin, end), distributed over the workgroups.
#define FOR_EACH_BLOCK(firstSample, begin, end)                                     \
  for (uint firstSample = (begin) + gl_WorkGroupID.x * kBlock; firstSample < (end); \
       firstSample += gl_NumWorkGroups.x * kBlock)
