// Fused MLP: a block of samples stays in cache through all layers. Everything is row-major (one row a sample), so that
// forward (X · Wᵀ), input gradient (dY · W) and weight gradient (dYᵀ · X) are three products whose inner loop is
// "broadcast one number, multiply-add a few vectors", with the accumulators in registers.

#include "compute/mlp.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "compute/cpu/mlp.cpp"
#include <hwy/foreach_target.h>
// after foreach_target
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#ifndef TESSERA_CPU_MLP_ONCE
#define TESSERA_CPU_MLP_ONCE
namespace tessera::cpu {

inline constexpr int kRows = 96;  // samples of a block: a multiple of every tile height below
inline constexpr int kMaxWidth = 128;
inline constexpr int kParts = 32;  // partial weight gradients, whatever the number of threads

struct BlockBuffers {  // of one thread
  alignas(128) float input[kRows * kMaxWidth];
  alignas(128) float hidden[2][kRows * kMaxWidth];
  alignas(128) float output[kRows * kMaxWidth];
  alignas(128) float gradient[2][kRows * kMaxWidth];
};

}  // namespace tessera::cpu
#endif

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 16 lanes: every padded size is then a whole number of vectors.
using Float = hn::CappedTag<float, 16>;
using Vector = hn::Vec<Float>;

#if HWY_TARGET <= HWY_AVX3
constexpr int kWide = 4;  // vectors side by side in a tile: 32 registers
#else
constexpr int kWide = 2;  // 16 registers
#endif

// out[r][v] = Σ_k x[r · xRow + k · xStep] · b[k · bRow + v · lanes]
template <int R, int V>
HWY_INLINE void productTile(const float* HWY_RESTRICT x, size_t xRow, size_t xStep, const float* HWY_RESTRICT b,
                            size_t bRow, int depth, Vector (&sum)[R][V]) {
  const Float d;
  const size_t lanes = hn::Lanes(d);
  for (int r = 0; r < R; ++r) {
    for (int v = 0; v < V; ++v) sum[r][v] = hn::Zero(d);
  }
  for (int k = 0; k < depth; ++k) {
    Vector row[V];
    for (int v = 0; v < V; ++v) row[v] = hn::LoadU(d, b + k * bRow + v * lanes);
    for (int r = 0; r < R; ++r) {
      const Vector factor = hn::Set(d, x[r * xRow + k * xStep]);
      for (int v = 0; v < V; ++v) sum[r][v] = hn::MulAdd(factor, row[v], sum[r][v]);
    }
  }
}

enum class Finish { none, relu, maskByActivation };

// out[rows][columns] = finish(x[rows][depth] · b[depth][columns]); rows a multiple of R.
template <int R, int V, Finish kFinish>
HWY_NOINLINE void productBlock(const float* x, size_t xRow, const float* b, int depth, int columns, int rows,
                               float* out, size_t outRow, const float* activation, size_t activationRow) {
  const Float d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int column = 0; column < columns; column += V * lanes) {
    for (int row = 0; row < rows; row += R) {
      Vector sum[R][V];
      productTile<R, V>(x + row * xRow, xRow, 1, b + column, columns, depth, sum);
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
void product(const float* x, size_t xRow, const float* b, int depth, int columns, float* out, size_t outRow,
             const float* activation = nullptr, size_t activationRow = 0) {
  const int vectors = columns / static_cast<int>(hn::Lanes(Float()));
  if (vectors % 4 == 0 && kWide == 4) {
    productBlock<6, kWide, kFinish>(x, xRow, b, depth, columns, kRows, out, outRow, activation, activationRow);
  } else if (vectors % 2 == 0) {
    productBlock<kWide == 4 ? 12 : 6, 2, kFinish>(x, xRow, b, depth, columns, kRows, out, outRow, activation,
                                                  activationRow);
  } else {
    productBlock<12, 1, kFinish>(x, xRow, b, depth, columns, kRows, out, outRow, activation, activationRow);
  }
}

// sum[o][i] += Σ_rows dy[row][o] · x[row][i]
template <int R, int V>
HWY_NOINLINE void outerBlock(const float* dy, size_t dyRow, const float* x, size_t xRow, int outputs, int inputs,
                             float* sum) {
  const Float d;
  const int lanes = static_cast<int>(hn::Lanes(d));
  for (int i = 0; i < inputs; i += V * lanes) {
    for (int o = 0; o < outputs; o += R) {
      Vector tile[R][V];
      productTile<R, V>(dy + o, 1, dyRow, x + i, xRow, kRows, tile);
      for (int r = 0; r < R; ++r) {
        for (int v = 0; v < V; ++v) {
          float* to = sum + static_cast<size_t>(o + r) * inputs + i + v * lanes;
          hn::StoreU(hn::Add(hn::LoadU(d, to), tile[r][v]), d, to);
        }
      }
    }
  }
}

void outer(const float* dy, size_t dyRow, const float* x, size_t xRow, int outputs, int inputs, float* sum) {
  const int vectors = inputs / static_cast<int>(hn::Lanes(Float()));
  if (vectors % 4 == 0 && kWide == 4) {
    outerBlock<4, kWide>(dy, dyRow, x, xRow, outputs, inputs, sum);
  } else if (vectors % 2 == 0) {
    outerBlock<kWide == 4 ? 8 : 4, 2>(dy, dyRow, x, xRow, outputs, inputs, sum);
  } else {
    outerBlock<kWide == 4 ? 16 : 8, 1>(dy, dyRow, x, xRow, outputs, inputs, sum);
  }
}

// Rows [first, first + rows) of a matrix into a block of `width` columns; missing rows and columns are zero.
void packRows(const Matrix<const float>& matrix, const float* data, size_t first, int rows, int width, float* block) {
  const int columns = static_cast<int>(matrix.columns);
  if (matrix.groupWidth == 2) {
    for (int g = 0; g < columns / 2; ++g) {
      const float* from = data + g * matrix.groupStride + first * matrix.rowStride;
      for (int r = 0; r < rows; ++r) std::memcpy(block + r * width + g * 2, from + r * matrix.rowStride, 8);
    }
  } else if (matrix.groupWidth == 0) {
    for (int r = 0; r < rows; ++r) {
      std::memcpy(block + r * width, data + (first + r) * matrix.rowStride, sizeof(float) * columns);
    }
  } else {
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns; ++c) block[r * width + c] = data[matrix.offset(first + r, c)];
    }
  }
  if (columns < width) {
    for (int r = 0; r < rows; ++r) std::memset(block + r * width + columns, 0, sizeof(float) * (width - columns));
  }
  if (rows < kRows) std::memset(block + rows * width, 0, sizeof(float) * (kRows - rows) * width);
}

void unpackRows(const float* block, int width, const Matrix<float>& matrix, float* data, size_t first, int rows) {
  const int columns = static_cast<int>(matrix.columns);
  if (matrix.groupWidth == 2) {
    for (int g = 0; g < columns / 2; ++g) {
      float* to = data + g * matrix.groupStride + first * matrix.rowStride;
      for (int r = 0; r < rows; ++r) std::memcpy(to + r * matrix.rowStride, block + r * width + g * 2, 8);
    }
  } else if (matrix.groupWidth == 0) {
    for (int r = 0; r < rows; ++r) {
      std::memcpy(data + (first + r) * matrix.rowStride, block + r * width, sizeof(float) * columns);
    }
  } else {
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < columns; ++c) data[matrix.offset(first + r, c)] = block[r * width + c];
    }
  }
}

// The rows as the kernels want them: in place where they are whole, row-major and wide enough, else packed.
const float* blockRows(const Matrix<const float>& matrix, const float* data, size_t first, int rows, int width,
                       float* block, size_t* stride) {
  if (rows == kRows && matrix.groupWidth == 0 && static_cast<int>(matrix.columns) == width) {
    *stride = matrix.rowStride;
    return data + first * matrix.rowStride;
  }
  packRows(matrix, data, first, rows, width, block);
  *stride = width;
  return block;
}

void sigmoidBlock(float* block, int count) {
  const Float d;
  const Vector one = hn::Set(d, 1.0f);
  for (int i = 0; i < count; i += static_cast<int>(hn::Lanes(d))) {
    const Vector x = hn::Load(d, block + i);
    hn::Store(hn::Div(one, hn::Add(one, hn::Exp(d, hn::Neg(x)))), d, block + i);
  }
}

void forwardBlock(const MlpForward& a, const float* transposed, size_t n, size_t first, BlockBuffers& buffers) {
  const MlpShape& shape = a.shape;
  const int rows = static_cast<int>(std::min<size_t>(kRows, n - first));
  size_t stride = 0;
  const float* x =
      blockRows(a.input, hostPointer(a.input.data), first, rows, shape.layerInputs(0), buffers.input, &stride);
  float* kept = hostPointer(a.activations);
  for (int l = 0; l < shape.hiddenLayers; ++l) {
    float* h = buffers.hidden[l % 2];
    float* keep = kept ? kept + (static_cast<size_t>(l) * a.samples.capacity + first) * shape.width : nullptr;
    if (keep && rows == kRows) h = keep;
    product<Finish::relu>(x, stride, transposed + shape.weightOffset(l), shape.layerInputs(l), shape.width, h,
                          shape.width);
    if (keep && h != keep) std::memcpy(keep, h, sizeof(float) * rows * shape.width);
    x = h;
    stride = shape.width;
  }
  const int last = shape.hiddenLayers, outputs = shape.layerOutputs(last);
  product<Finish::none>(x, stride, transposed + shape.weightOffset(last), shape.width, outputs, buffers.output,
                        outputs);
  if (shape.activation == OutputActivation::sigmoid) sigmoidBlock(buffers.output, kRows * outputs);
  unpackRows(buffers.output, outputs, a.output, hostPointer(a.output.data), first, rows);
}

// dY of a block: the given gradient through the output activation, zero beyond the real rows and columns.
void outputGradientBlock(const MlpBackward& a, size_t first, int rows, float* dy) {
  const MlpShape& shape = a.shape;
  const int width = shape.layerOutputs(shape.hiddenLayers);
  packRows(a.outputGradients, hostPointer(a.outputGradients.data), first, rows, width, dy);
  if (a.firstOutputGradients) {
    const float* extra = hostPointer(a.firstOutputGradients) + first;
    for (int r = 0; r < rows; ++r) dy[r * width] += extra[r];
  }
  if (shape.activation == OutputActivation::sigmoid) {
    const float* y = hostPointer(a.output.data);
    for (int r = 0; r < rows; ++r) {
      for (int c = 0; c < shape.outputs; ++c) {
        const float value = y[a.output.offset(first + r, c)];
        dy[r * width + c] *= value * (1 - value);
      }
    }
  }
}

void backwardBlock(const MlpBackward& a, size_t n, size_t first, float* weightGradients, BlockBuffers& buffers) {
  const MlpShape& shape = a.shape;
  const int rows = static_cast<int>(std::min<size_t>(kRows, n - first));
  const float* weights = hostPointer(a.weights);
  const float* kept = hostPointer(a.activations);
  const size_t width = shape.width;
  outputGradientBlock(a, first, rows, buffers.output);
  const float* dy = buffers.output;
  size_t dyStride = shape.layerOutputs(shape.hiddenLayers);
  for (int l = shape.hiddenLayers; l >= 0; --l) {
    const int outputs = shape.layerOutputs(l), inputs = shape.layerInputs(l);
    const float* x;
    size_t xStride = width;
    if (l > 0) {
      x = kept + (static_cast<size_t>(l - 1) * a.samples.capacity + first) * width;
      if (rows < kRows) {
        std::memcpy(buffers.hidden[0], x, sizeof(float) * rows * width);
        std::memset(buffers.hidden[0] + rows * width, 0, sizeof(float) * (kRows - rows) * width);
        x = buffers.hidden[0];
      }
    } else {
      x = blockRows(a.input, hostPointer(a.input.data), first, rows, inputs, buffers.input, &xStride);
    }
    outer(dy, dyStride, x, xStride, outputs, inputs, weightGradients + shape.weightOffset(l));
    if (l == 0 && !a.inputGradients) break;
    float* dx = buffers.gradient[l % 2];
    if (l > 0) {
      product<Finish::maskByActivation>(dy, dyStride, weights + shape.weightOffset(l), outputs, inputs, dx, inputs, x,
                                        xStride);
    } else {
      product<Finish::none>(dy, dyStride, weights + shape.weightOffset(l), outputs, inputs, dx, inputs);
      unpackRows(dx, inputs, a.inputGradients, hostPointer(a.inputGradients.data), first, rows);
    }
    dy = dx;
    dyStride = inputs;
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(forwardBlock);
HWY_EXPORT(backwardBlock);

namespace {

void checkShape(const MlpShape& shape) {
  CHECK((shape.width == 16 || shape.width == 32 || shape.width == 64 || shape.width == 128));
  CHECK(shape.hiddenLayers >= 1);
  CHECK(shape.inputs <= kMaxWidth);
  CHECK(shape.outputs <= kMaxWidth);
}

// Each layer's [outputs][inputs] as [inputs][outputs].
std::vector<float> transposeLayers(const MlpShape& shape, const float* weights) {
  std::vector<float> transposed(shape.parameters());
  for (int l = 0; l < shape.layers(); ++l) {
    const int outputs = shape.layerOutputs(l), inputs = shape.layerInputs(l);
    const float* from = weights + shape.weightOffset(l);
    float* to = transposed.data() + shape.weightOffset(l);
    for (int o = 0; o < outputs; ++o) {
      for (int i = 0; i < inputs; ++i) to[i * outputs + o] = from[o * inputs + i];
    }
  }
  return transposed;
}

BlockBuffers& threadBuffers() {
  thread_local const std::unique_ptr<BlockBuffers> buffers = std::make_unique<BlockBuffers>();
  return *buffers;
}

}  // namespace

void run(Context& context, const MlpForward& a) {
  checkShape(a.shape);
  CHECK(a.output.groupWidth == 0u);
  const size_t n = hostCount(a.samples);
  const size_t blocks = (n + kRows - 1) / kRows;
  const std::vector<float> transposed = transposeLayers(a.shape, hostPointer(a.weights));
  const auto block = HWY_DYNAMIC_DISPATCH(forwardBlock);
  context.pool.forRanges(blocks, 8, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) block(a, transposed.data(), n, b * kRows, threadBuffers());
  });
}

void run(Context& context, const MlpBackward& a) {
  checkShape(a.shape);
  const size_t n = hostCount(a.samples);
  const size_t blocks = (n + kRows - 1) / kRows, parameters = a.shape.parameters();
  if (n == 0) return;
  const size_t parts = std::min<size_t>(kParts, blocks);
  std::vector<float> partial(parts * parameters);
  const auto block = HWY_DYNAMIC_DISPATCH(backwardBlock);
  context.pool.run(parts, [&](size_t part, int) {
    for (size_t b = part * blocks / parts; b < (part + 1) * blocks / parts; ++b) {
      block(a, n, b * kRows, partial.data() + part * parameters, threadBuffers());
    }
  });
  float* sum = hostPointer(a.weightGradients);
  for (size_t part = 0; part < parts; ++part) {
    for (size_t i = 0; i < parameters; ++i) sum[i] += partial[part * parameters + i];
  }
}

}  // namespace tessera::cpu
#endif
