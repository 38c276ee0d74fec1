// The number type of vectors and weights: fp16 with TESSERA_HALF, otherwise float. Sums are always floats.
// Defines: Number, NumberQuad, NumberPointer, QuadPointer, isNoNumber(), atLeast(), toNumber(); with TESSERA_HALF also
// kMaxHalf and withinHalf().
#extension GL_EXT_buffer_reference : require

// NaN is preserved. It is detected by its bits, as compilers may replace a comparison by max(), which discards NaN.
bool isNoNumber(float x) { return (floatBitsToUint(x) & 0x7fffffffu) > 0x7f800000u; }
float atLeast(float x, float minimum) { return isNoNumber(x) ? x : max(x, minimum); }

#ifdef TESSERA_HALF
#extension GL_EXT_shader_explicit_arithmetic_types_float16 : require
#extension GL_EXT_shader_16bit_storage : require
#define Number float16_t
#define NumberQuad f16vec4
const float kMaxHalf = 65504;
// Clamps to the range of fp16.
float withinHalf(float x) { return isNoNumber(x) ? x : clamp(x, -kMaxHalf, kMaxHalf); }
Number toNumber(float x) { return float16_t(withinHalf(x)); }
#else
#define Number float
#define NumberQuad vec4
Number toNumber(float x) { return x; }
#endif

layout(buffer_reference, std430, buffer_reference_align = 16) buffer NumberPointer { Number values[]; };
layout(buffer_reference, std430) buffer QuadPointer { NumberQuad values[]; };
