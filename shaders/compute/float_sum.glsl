// Atomic float sums. Include before kernel.glsl.
// Defines: SumPointer, addTo(). With TESSERA_FLOAT_ATOMICS they use hardware atomics, otherwise a compare-and-swap
// loop.
#extension GL_EXT_buffer_reference : require
#define TESSERA_SUM_POINTER

#ifdef TESSERA_FLOAT_ATOMICS
#extension GL_EXT_shader_atomic_float : require
layout(buffer_reference, std430, buffer_reference_align = 4) buffer SumPointer { float values[]; };

void addTo(SumPointer sums, uint index, float value) { atomicAdd(sums.values[index], value); }

#else
layout(buffer_reference, std430, buffer_reference_align = 4) buffer SumPointer { uint values[]; };

void addTo(SumPointer sums, uint index, float value) {
  uint seen = sums.values[index];
  for (;;) {
    const uint before = atomicCompSwap(sums.values[index], seen, floatBitsToUint(uintBitsToFloat(seen) + value));
    if (before == seen) return;
    seen = before;
  }
}
#endif
