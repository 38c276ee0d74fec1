// Products of 16 × 16 matrices by all lanes of a subgroup together: fp16 times fp16, summed in float.
// Defines: TileA, TileB, TileSum, LOAD_A(), LOAD_B(), CLEAR_SUM(), MULTIPLY_ADD(), STORE_SUM(), kSubgroup,
// kLane, subgroupWait(), CONVERT_AND_STORE(). `element` and `stride` are in numbers of `array`, multiples of 8.
//
// By VK_NV_cooperative_matrix; with TESSERA_EMULATED_MATRICES by loops over what each lane holds, so that kernels which
// use them can be tested on any device. All invocations of a workgroup call these together.

const uint kSubgroupSize = 32;

float atLeast(float x, float least) { return x < least ? least : x; }  // what is no number stays none

#ifdef TESSERA_EMULATED_MATRICES
// A lane holds one row of A, eight columns of B, and where they meet eight sums. Callers know no `nth` and no `inner`.
struct TileA { float numbers[16]; };
struct TileB { float numbers[128]; };
struct TileSum { float numbers[8]; };
#define kSubgroup (gl_LocalInvocationIndex / kSubgroupSize)
#define kLane (gl_LocalInvocationIndex % kSubgroupSize)
#define LANE_ROW (kLane / 2)
#define LANE_COLUMN (kLane % 2 * 8)
#define AT(element, stride, columnMajor, row, column) \
  ((element) + ((columnMajor) ? (column) * (stride) + (row) : (row) * (stride) + (column)))
#define LOAD_A(tile, array, element, stride, columnMajor) \
  for (uint inner = 0; inner < 16; ++inner)               \
  tile.numbers[inner] = float(array[AT(element, stride, columnMajor, LANE_ROW, inner)])
#define LOAD_B(tile, array, element, stride, columnMajor) \
  for (uint nth = 0; nth < 128; ++nth)                    \
  tile.numbers[nth] = float(array[AT(element, stride, columnMajor, nth / 8, LANE_COLUMN + nth % 8)])
#define CLEAR_SUM(sum) \
  for (uint nth = 0; nth < 8; ++nth) sum.numbers[nth] = 0
#define MULTIPLY_ADD(sum, a, b)           \
  for (uint nth = 0; nth < 128; ++nth) \
  sum.numbers[nth % 8] += a.numbers[nth / 8] * b.numbers[nth]
#define STORE_SUM(sum, array, element, stride) \
  for (uint nth = 0; nth < 8; ++nth)           \
  array[AT(element, stride, false, LANE_ROW, LANE_COLUMN + nth)] = sum.numbers[nth]
// As fp16; `sum` holds nothing of use afterwards.
#define CONVERT_AND_STORE(sum, least, array, element, stride) \
  for (uint nth = 0; nth < 8; ++nth)                          \
  array[AT(element, stride, false, LANE_ROW, LANE_COLUMN + nth)] = toNumber(atLeast(sum.numbers[nth], least))
void subgroupWait() { barrier(); }

#else
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_NV_cooperative_matrix : require
#define TileA fcoopmatNV<16, gl_ScopeSubgroup, 16, 16>
#define TileB fcoopmatNV<16, gl_ScopeSubgroup, 16, 16>
#define TileSum fcoopmatNV<32, gl_ScopeSubgroup, 16, 16>
#define kSubgroup gl_SubgroupID
#define kLane gl_SubgroupInvocationID
#define LOAD_A(tile, array, element, stride, columnMajor) coopMatLoadNV(tile, array, element, stride, columnMajor)
#define LOAD_B(tile, array, element, stride, columnMajor) coopMatLoadNV(tile, array, element, stride, columnMajor)
#define CLEAR_SUM(sum) sum = TileSum(0.0)
#define MULTIPLY_ADD(sum, a, b) sum = coopMatMulAddNV(a, b, sum)
#define STORE_SUM(sum, array, element, stride) coopMatStoreNV(sum, array, element, stride, false)
// Which lane holds what is the driver's affair, and may differ between fp16 and float: only whole matrices convert.
#define CONVERT_AND_STORE(sum, least, array, element, stride)                                   \
  {                                                                                             \
    for (uint i = 0; i < sum.length(); ++i) sum[i] = withinHalf(atLeast(sum[i], least));        \
    coopMatStoreNV(TileA(sum), array, element, stride, false);                                  \
  }
void subgroupWait() { subgroupBarrier(); }
#endif
