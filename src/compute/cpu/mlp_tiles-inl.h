// The three matrix products of the fused MLP on blocks of kRows samples, computed by register tiles. Part of mlp.cpp,
// which includes it once for each SIMD target (Highway's -inl.h convention, in which the include guard toggles).
#if defined(TESSERA_COMPUTE_CPU_MLP_TILES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TESSERA_COMPUTE_CPU_MLP_TILES_INL_H_
#undef TESSERA_COMPUTE_CPU_MLP_TILES_INL_H_
#else
#define TESSERA_COMPUTE_CPU_MLP_TILES_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 16 lanes: every padded size is then a whole number of vectors.
using Float = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Float>;

#if HWY_TARGET <= HWY_AVX3
constexpr int kWide = 4;          // vectors side by side in a tile, with 32 registers
constexpr bool kShuffles = true;  // loads four numbers at once and broadcasts each, to save loads per multiply-add
#else
constexpr int kWide = 2;  // with 16 registers
constexpr bool kShuffles = false;
#endif

// Numbers to broadcast: the elements (row, column) of a block in any layout of Matrix.
struct Numbers {
  const float* data;
  size_t rowStride;
  size_t groupStride = 0;  // 0: row-major
  uint32_t groupWidth = 0;
};

// Numbers with a layout that is known at compile time, so that the rows of a tile are constant distances apart.
//   kStride  16 to 128   row-major with this row stride
//            2           planes of two columns, as written by the hash grid
//            0           any other layout
template <int kStride>
struct NumbersOf {
  const float* data;
  size_t rowStride, groupStride;
  uint32_t groupWidth;

  explicit NumbersOf(const Numbers& x)
      : data(x.data), rowStride(x.rowStride), groupStride(x.groupStride), groupWidth(x.groupWidth) {}
  HWY_INLINE const float* column(int c) const {
    if (kStride > 2) return data + c;
    if (kStride == 2) return data + (c >> 1) * groupStride + (c & 1);
    return groupStride ? data + c / groupWidth * groupStride + c % groupWidth : data + c;
  }
  HWY_INLINE size_t row(int r) const { return kStride ? size_t{kStride} * r : rowStride * r; }
};

template <int kStride>
struct Stride {
  static constexpr int value = kStride;
};

// Calls call(Stride<kStride>()) with the most specific stride for `x`.
template <class Call>
void withStride(const Numbers& x, const Call& call) {
  if (x.groupStride != 0) return x.groupWidth == 2 && x.rowStride == 2 ? call(Stride<2>()) : call(Stride<0>());
  switch (x.rowStride) {
    case 16:
      return call(Stride<16>());
    case 32:
      return call(Stride<32>());
    case 64:
      return call(Stride<64>());
    case 128:
      return call(Stride<128>());
    default:
      return call(Stride<0>());
  }
}

// out[r][v] = Σ_k x(row + r, column k) · b[k · bRow + v · lanes]
template <int R, int V, int kStride>
HWY_INLINE void productTile(const NumbersOf<kStride>& x, int row, const float* HWY_RESTRICT b, size_t bRow, int depth,
                            Vector (&sum)[R][V]) {
  const Float d;
  const size_t lanes = hn::Lanes(d);
  for (int r = 0; r < R; ++r) {
    for (int v = 0; v < V; ++v) sum[r][v] = hn::Zero(d);
  }
  const size_t firstRow = x.row(row);
  if constexpr (kShuffles && V <= 2 && kStride > 2) {
    for (int k = 0; k < depth; k += 4) {  // depths are multiples of 4
      Vector vectors[4][V];
      for (int i = 0; i < 4; ++i) {
        for (int v = 0; v < V; ++v) vectors[i][v] = hn::LoadU(d, b + (k + i) * bRow + v * lanes);
      }
      for (int r = 0; r < R; ++r) {
        const Vector four = hn::LoadDup128(d, x.data + firstRow + x.row(r) + k);
        for (int v = 0; v < V; ++v) {
          sum[r][v] = hn::MulAdd(hn::Broadcast<0>(four), vectors[0][v], sum[r][v]);
          sum[r][v] = hn::MulAdd(hn::Broadcast<1>(four), vectors[1][v], sum[r][v]);
          sum[r][v] = hn::MulAdd(hn::Broadcast<2>(four), vectors[2][v], sum[r][v]);
          sum[r][v] = hn::MulAdd(hn::Broadcast<3>(four), vectors[3][v], sum[r][v]);
        }
      }
    }
    return;
  }
  for (int k = 0; k < depth; ++k) {
    Vector vectors[V];
    for (int v = 0; v < V; ++v) vectors[v] = hn::LoadU(d, b + k * bRow + v * lanes);
    const float* HWY_RESTRICT numbers = x.column(k) + firstRow;
    for (int r = 0; r < R; ++r) {
      const Vector factor = hn::Set(d, numbers[x.row(r)]);
      for (int v = 0; v < V; ++v) sum[r][v] = hn::MulAdd(factor, vectors[v], sum[r][v]);
    }
  }
}

// sum[r][v] = Σ_rows x(row, column + r) · b[row · bRow + v · lanes]
template <int R, int V, int kStride>
HWY_INLINE void outerTile(const NumbersOf<kStride>& x, int column, const float* HWY_RESTRICT b, size_t bRow, int rows,
                          Vector (&sum)[R][V]) {
  const Float d;
  const size_t lanes = hn::Lanes(d);
  const float* columns[R];
  for (int r = 0; r < R; ++r) {
    columns[r] = kStride > 2 ? x.column(column) + r : x.column(column + r);
    for (int v = 0; v < V; ++v) sum[r][v] = hn::Zero(d);
  }
  for (int row = 0; row < rows; ++row) {
    Vector vectors[V];
    for (int v = 0; v < V; ++v) vectors[v] = hn::LoadU(d, b + row * bRow + v * lanes);
    for (int r = 0; r < R; ++r) {
      const Vector factor = hn::Set(d, columns[r][x.row(row)]);
      for (int v = 0; v < V; ++v) sum[r][v] = hn::MulAdd(factor, vectors[v], sum[r][v]);
    }
  }
}

enum class Finish { none, relu, maskByActivation };

// out[rows][columns] = finish(x[rows][depth] · b[depth][columns]); `rows` is a multiple of R.
template <int R, int V, Finish kFinish, int kStride>
HWY_NOINLINE void productBlock(const NumbersOf<kStride>& x, const float* b, int depth, int columns, int rows,
                               float* out, size_t outRow, const float* activation, size_t activationRow) {
  const Float d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int column = 0; column < columns; column += V * lanes) {
    for (int row = 0; row < rows; row += R) {
      Vector sum[R][V];
      productTile<R, V>(x, row, b + column, columns, depth, sum);
      for (int r = 0; r < R; ++r) {
        for (int v = 0; v < V; ++v) {
          Vector value = sum[r][v];
          if constexpr (kFinish == Finish::relu) value = hn::Max(value, hn::Zero(d));
          if constexpr (kFinish == Finish::maskByActivation) {
            const Vector h = hn::LoadU(d, activation + (row + r) * activationRow + column + v * lanes);
            value = hn::IfThenElseZero(hn::Gt(h, hn::Zero(d)), value);
          }
          hn::StoreU(value, d, out + (row + r) * outRow + column + v * lanes);
        }
      }
    }
  }
}

template <Finish kFinish>
void product(const Numbers& x, const float* b, int depth, int columns, float* out, size_t outRow,
             const float* activation = nullptr, size_t activationRow = 0) {
  const int vectors = columns / static_cast<int>(hn::Lanes(Float()));
  withStride(x, [&](auto stride) {
    const NumbersOf<decltype(stride)::value> numbers(x);
    if (vectors % 4 == 0 && kWide == 4) {
      productBlock<6, kWide, kFinish>(numbers, b, depth, columns, kRows, out, outRow, activation, activationRow);
    } else if (vectors % 2 == 0) {
      productBlock<kWide == 4 ? 12 : 6, 2, kFinish>(numbers, b, depth, columns, kRows, out, outRow, activation,
                                                    activationRow);
    } else {
      productBlock<kWide == 4 ? 24 : 12, 1, kFinish>(numbers, b, depth, columns, kRows, out, outRow, activation,
                                                     activationRow);
    }
  });
}

// sum[i][o] += Σ_rows x(row, i) · y[row][o]; x has `inputs` columns, y `outputs`.
template <int R, int V, int kStride>
HWY_NOINLINE void outerBlock(const NumbersOf<kStride>& x, int inputs, const float* y, size_t yRow, int outputs,
                             float* sum) {
  const Float d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int o = 0; o < outputs; o += V * lanes) {
    for (int i = 0; i < inputs; i += R) {
      Vector tile[R][V];
      outerTile<R, V>(x, i, y + o, yRow, kRows, tile);
      for (int r = 0; r < R; ++r) {
        for (int v = 0; v < V; ++v) {
          float* to = sum + static_cast<size_t>(i + r) * outputs + o + v * lanes;
          hn::StoreU(hn::Add(hn::LoadU(d, to), tile[r][v]), d, to);
        }
      }
    }
  }
}

inline void outer(const Numbers& x, int inputs, const float* y, size_t yRow, int outputs, float* sum) {
  const int vectors = outputs / static_cast<int>(hn::Lanes(Float()));
  withStride(x, [&](auto stride) {
    const NumbersOf<decltype(stride)::value> numbers(x);
    if (vectors % 4 == 0 && kWide == 4) {
      outerBlock<4, kWide>(numbers, inputs, y, yRow, outputs, sum);
    } else if (vectors % 2 == 0) {
      outerBlock<kWide == 4 ? 8 : 4, 2>(numbers, inputs, y, yRow, outputs, sum);
    } else {
      outerBlock<kWide == 4 ? 16 : 8, 1>(numbers, inputs, y, yRow, outputs, sum);
    }
  });
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per target
