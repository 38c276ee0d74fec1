// Sums over a workgroup of 256 invocations, always in the same order on the same device: with subgroup arithmetic if
// TESSERA_SUBGROUPS is defined, otherwise by a tree reduction in shared memory.
// Defines: groupSum().

shared float groupSums[256];

// Returns the sum over all invocations to each of them. All invocations must call it together.
#ifdef TESSERA_SUBGROUPS
#extension GL_KHR_shader_subgroup_arithmetic : require
float groupSum(float own) {
  const float ofSubgroup = subgroupAdd(own);
  barrier();
  if (subgroupElect()) groupSums[gl_SubgroupID] = ofSubgroup;
  barrier();
  float sum = 0;
  for (uint i = 0; i < gl_NumSubgroups; ++i) sum += groupSums[i];
  return sum;
}
#else
float groupSum(float own) {
  barrier();
  groupSums[gl_LocalInvocationIndex] = own;
  for (uint width = 128; width > 0; width /= 2) {
    barrier();
    if (gl_LocalInvocationIndex < width) groupSums[gl_LocalInvocationIndex] += groupSums[gl_LocalInvocationIndex + width];
  }
  barrier();
  return groupSums[0];
}
#endif
