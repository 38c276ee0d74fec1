// What kernels keep vectors and weights as: fp16 with TESSERA_HALF, else float. Sums are floats either way.
// Defines: Number, NumberQuad, NumberPointer, QuadPointer, isNoNumber(), atLeast(), toNumber(); of fp16 also kMostHalf and
// withinHalf().
#extension GL_EXT_buffer_reference : require

// What is no number stays none: told by its bits, as compilers take a comparison for max(), which drops it.
bool isNoNumber(float x) { return (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u; }
float atLeast(float x, float least) { return isNoNumber(x) ? x : max(x, least); }

#ifdef TESSERA_HALF
#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require
#extension GL_EXT_shader_16bit_storage : require
#define Number float16_t
#define NumberQuad f16vec4
const float kMostHalf = 65504;
// What is beyond fp16 becomes its largest.
float withinHalf(float x) { return isNoNumber(x) ? x : clamp(x, -kMostHalf, kMostHalf); }
Number toNumber(float x) { return float16_t(withinHalf(x)); }
#else
#define Number float
#define NumberQuad vec4
Number toNumber(float x) { return x; }
#endif

layout(buffer_reference, std430, buffer_reference_align = 16) buffer NumberPointer { Number values[]; };
layout(buffer_reference, std430) buffer QuadPointer { NumberQuad values[]; };
