// Cooperative matrices: all lanes of a subgroup multiply small fp16 matrices together and sum the products in float.
// Defines: kTileRows, kTileColumns, kTileDepth, which divide 16; kSubgroupSize, kSubgroups of a workgroup, kThreads,
// kSubgroup, kLane, subgroupWait(); TileA (rows × depth), TileB (depth × columns), TileSum (rows × columns); LOAD_A(),
// LOAD_B(), CLEAR_SUM(), MULTIPLY_ADD(), STORE_SUM(), CONVERT_AND_STORE(). `element` and `stride` count numbers of
// `array` and are multiples of 8. All invocations of a workgroup must call subgroupWait() together; all invocations of
// a subgroup must use the other functions together.
//
// They use VK_KHR_cooperative_matrix (TESSERA_KHR_MATRICES), VK_NV_cooperative_matrix, or, with
// TESSERA_EMULATED_MATRICES, loops over the elements of each lane, so that kernels that use them can be tested on any
// device.

layout(constant_id = 3) const uint kSubgroupSize = 32;
layout(constant_id = 4) const uint kTileRows = 16;
layout(constant_id = 5) const uint kTileColumns = 16;
layout(constant_id = 6) const uint kTileDepth = 16;
layout(local_size_x_id = 7) in;  // kThreads

const uint kSubgroups = 4;
const uint kThreads = kSubgroups * kSubgroupSize;

#ifdef TESSERA_EMULATED_MATRICES
// A lane has one row of A, some columns of B, and the sums of their products. Callers must not use the names `nth` and
// `inner`.
const uint kColumnsOfLane = kTileRows * kTileColumns / kSubgroupSize;
const uint kLanesOfRow = kTileColumns / kColumnsOfLane;
struct TileA { float numbers[kTileDepth]; };
struct TileB { float numbers[kTileDepth * kColumnsOfLane]; };
struct TileSum { float numbers[kColumnsOfLane]; };
#define kSubgroup (gl_LocalInvocationIndex / kSubgroupSize)
#define kLane (gl_LocalInvocationIndex % kSubgroupSize)
#define LANE_ROW (kLane / kLanesOfRow)
#define LANE_COLUMN (kLane % kLanesOfRow * kColumnsOfLane)
#define AT(element, stride, columnMajor, row, column) \
  ((element) + ((columnMajor) ? (column) * (stride) + (row) : (row) * (stride) + (column)))
#define LOAD_A(tile, array, element, stride, columnMajor)   \
  for (uint inner = 0; inner < kTileDepth; ++inner)         \
  tile.numbers[inner] = float(array[AT(element, stride, columnMajor, LANE_ROW, inner)])
#define LOAD_B(tile, array, element, stride, columnMajor)               \
  for (uint nth = 0; nth < kTileDepth * kColumnsOfLane; ++nth)          \
  tile.numbers[nth] = float(                                            \
      array[AT(element, stride, columnMajor, nth / kColumnsOfLane, LANE_COLUMN + nth % kColumnsOfLane)])
#define CLEAR_SUM(sum) \
  for (uint nth = 0; nth < kColumnsOfLane; ++nth) sum.numbers[nth] = 0
#define MULTIPLY_ADD(sum, a, b)                                \
  for (uint nth = 0; nth < kTileDepth * kColumnsOfLane; ++nth) \
  sum.numbers[nth % kColumnsOfLane] += a.numbers[nth / kColumnsOfLane] * b.numbers[nth]
#define STORE_SUM(sum, array, element, stride)      \
  for (uint nth = 0; nth < kColumnsOfLane; ++nth)   \
  array[AT(element, stride, false, LANE_ROW, LANE_COLUMN + nth)] = sum.numbers[nth]
// Stores as fp16; `sum` is undefined afterwards.
#define CONVERT_AND_STORE(sum, minimum, array, element, stride) \
  for (uint nth = 0; nth < kColumnsOfLane; ++nth)             \
  array[AT(element, stride, false, LANE_ROW, LANE_COLUMN + nth)] = toNumber(atLeast(sum.numbers[nth], minimum))
void subgroupWait() { barrier(); }

#else
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#ifdef TESSERA_KHR_MATRICES
#extension GL_KHR_cooperative_matrix : require
#define TileA coopmat<float16_t, gl_ScopeSubgroup, kTileRows, kTileDepth, gl_MatrixUseA>
#define TileB coopmat<float16_t, gl_ScopeSubgroup, kTileDepth, kTileColumns, gl_MatrixUseB>
#define TileSum coopmat<float, gl_ScopeSubgroup, kTileRows, kTileColumns, gl_MatrixUseAccumulator>
#define TileHalfSum coopmat<float16_t, gl_ScopeSubgroup, kTileRows, kTileColumns, gl_MatrixUseAccumulator>
#define LAYOUT(columnMajor) \
  ((columnMajor) ? gl_CooperativeMatrixLayoutColumnMajor : gl_CooperativeMatrixLayoutRowMajor)
#define LOAD_TILE(tile, array, element, stride, columnMajor) \
  coopMatLoad(tile, array, element, stride, LAYOUT(columnMajor))
#define STORE_SUM(sum, array, element, stride) coopMatStore(sum, array, element, stride, LAYOUT(false))
#define MULTIPLY_ADD(sum, a, b) sum = coopMatMulAdd(a, b, sum)
#else
#extension GL_NV_cooperative_matrix : require
#define TileA fcoopmatNV<16, gl_ScopeSubgroup, kTileRows, kTileDepth>
#define TileB fcoopmatNV<16, gl_ScopeSubgroup, kTileDepth, kTileColumns>
#define TileSum fcoopmatNV<32, gl_ScopeSubgroup, kTileRows, kTileColumns>
#define TileHalfSum fcoopmatNV<16, gl_ScopeSubgroup, kTileRows, kTileColumns>
#define LOAD_TILE(tile, array, element, stride, columnMajor) coopMatLoadNV(tile, array, element, stride, columnMajor)
#define STORE_SUM(sum, array, element, stride) coopMatStoreNV(sum, array, element, stride, false)
#define MULTIPLY_ADD(sum, a, b) sum = coopMatMulAddNV(a, b, sum)
#endif
#define LOAD_A LOAD_TILE
#define LOAD_B LOAD_TILE
#define kSubgroup gl_SubgroupID
#define kLane gl_SubgroupInvocationID
#define CLEAR_SUM(sum) sum = TileSum(0.0)
// The distribution of elements over lanes is up to the driver and may differ between fp16 and float, so only whole
// matrices can be converted.
#define CONVERT_AND_STORE(sum, minimum, array, element, stride)                             \
  {                                                                                       \
    for (uint i = 0; i < sum.length(); ++i) sum[i] = withinHalf(atLeast(sum[i], minimum));  \
    TileHalfSum converted = TileHalfSum(sum);                                             \
    STORE_SUM(converted, array, element, stride);                                         \
  }
void subgroupWait() { subgroupBarrier(); }
#endif
