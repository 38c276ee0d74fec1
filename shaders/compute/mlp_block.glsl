// How a workgroup takes its block of samples through a layer: by cooperative matrices (TESSERA_MATRICES) or without.
#ifdef TESSERA_MATRICES
#include "mlp_matrices.glsl"
#else
#include "mlp_tile.glsl"
#endif

// The first sample of every block of samples [begin, end), shared out among the workgroups.
#define FOR_EACH_BLOCK(firstSample, begin, end)                                     \
  for (uint firstSample = (begin) + gl_WorkGroupID.x * kBlock; firstSample < (end); \
       firstSample += gl_NumWorkGroups.x * kBlock)
