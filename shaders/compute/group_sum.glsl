// Sums over a workgroup of 256 invocations, always in the same order.
// Defines: groupSum().

shared float groupSums[256];

// → the sum over all invocations, to each of them. All call it together.
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
