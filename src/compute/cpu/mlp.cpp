// Fused MLP: a block of samples stays in the cache through all layers. The forward pass (X · Wᵀ), the input gradients
// (dY · W) and the weight gradients (dYᵀ · X) are three products whose inner loop broadcasts one number and
// multiply-adds a few vectors, with the accumulators in registers. Broadcast numbers may have any layout, so that the
// planes of the hash grid are read in place; vectors are rows, one row per sample.

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

inline constexpr int kRows = 96;  // samples per block; a multiple of every tile height
inline constexpr int kMaxWidth = 128;
inline constexpr int kParts = 16;  // partial weight gradients, and maximum of threads; fixed, for reproducible bits

struct BlockBuffers {  // per thread
  alignas(128) float input[kRows * kMaxWidth];
  alignas(128) float hidden[2][kRows * kMaxWidth];
  alignas(128) float output[kRows * kMaxWidth];
  alignas(128) float gradient[2][kRows * kMaxWidth];
};

}  // namespace tessera::cpu
#endif

#include "compute/cpu/mlp_tiles-inl.h"  // uses kRows

HWY_BEFORE_NAMESPACE();
namespace tessera::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Copies rows [first, first + rows) of a matrix into a block of `width` columns; missing rows and columns are zero.
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
    const int group = static_cast<int>(matrix.groupWidth);
    for (int c = 0; c < columns; c += group) {
      const float* from = data + matrix.offset(first, c);
      for (int r = 0; r < rows; ++r) {
        std::memcpy(block + r * width + c, from + r * matrix.rowStride, sizeof(float) * std::min(group, columns - c));
      }
    }
  }
  if (columns < width) {
    for (int r = 0; r < rows; ++r) std::memset(block + r * width + columns, 0, sizeof(float) * (width - columns));
  }
  if (rows < kRows) std::memset(block + rows * width, 0, sizeof(float) * (kRows - rows) * width);
}

// Copies the first columns of the rows of a block into a matrix.
void unpackRows(const float* block, int width, const Matrix<float>& matrix, float* data, size_t first, int rows) {
  const int columns = static_cast<int>(matrix.columns);
  if (matrix.groupWidth == 2) {
    // Copies two groups of two rows at a time.
    const hn::FixedTag<uint64_t, 2> d;
    const auto pair = [&](const float* from) { return hn::LoadU(d, reinterpret_cast<const uint64_t*>(from)); };
    const auto store = [&](hn::Vec<decltype(d)> value, float* to) {
      hn::StoreU(value, d, reinterpret_cast<uint64_t*>(to));
    };
    const int evenRows = matrix.rowStride == 2 ? rows / 2 * 2 : 0, evenGroups = columns / 4 * 2;
    for (int g = 0; g < columns / 2; ++g) {
      float* to = data + g * matrix.groupStride + first * matrix.rowStride;
      for (int r = g < evenGroups ? evenRows : 0; r < rows; ++r) {
        std::memcpy(to + r * matrix.rowStride, block + r * width + g * 2, 8);
      }
    }
    for (int r = 0; r < evenRows; r += 2) {
      for (int g = 0; g < evenGroups; g += 2) {
        const auto upper = pair(block + r * width + g * 2), lower = pair(block + (r + 1) * width + g * 2);
        float* to = data + g * matrix.groupStride + (first + r) * 2;
        store(hn::InterleaveLower(d, upper, lower), to);
        store(hn::InterleaveUpper(d, upper, lower), to + matrix.groupStride);
      }
    }
  } else if (matrix.groupWidth == 0) {
    for (int r = 0; r < rows; ++r) {
      std::memcpy(data + (first + r) * matrix.rowStride, block + r * width, sizeof(float) * columns);
    }
  } else {
    const int group = static_cast<int>(matrix.groupWidth);
    for (int c = 0; c < columns; c += group) {
      float* to = data + matrix.offset(first, c);
      for (int r = 0; r < rows; ++r) {
        std::memcpy(to + r * matrix.rowStride, block + r * width + c, sizeof(float) * std::min(group, columns - c));
      }
    }
  }
}

Numbers rowMajor(const float* data, size_t rowStride) {
  return {data, rowStride};
}

// Refers to the rows in place if the block is complete, otherwise to a packed copy in `block`.
Numbers blockNumbers(const Matrix<const float>& matrix, const float* data, size_t first, int rows, int width,
                     float* block) {
  if (rows < kRows || static_cast<int>(matrix.columns) != width) {
    packRows(matrix, data, first, rows, width, block);
    return rowMajor(block, width);
  }
  return {data + first * matrix.rowStride, matrix.rowStride, matrix.groupStride, matrix.groupWidth};
}

void sigmoidRow(float* row, int columns) {
  const Float d;
  const Vector one = hn::Set(d, 1.0f);
  for (int i = 0; i < columns; i += static_cast<int>(hn::Lanes(d))) {
    const Vector x = hn::Max(hn::LoadU(d, row + i), hn::Set(d, -80.0f));  // Exp is not defined beyond this
    hn::StoreU(hn::Div(one, hn::Add(one, hn::Exp(d, hn::Neg(x)))), d, row + i);
  }
}

void forwardBlock(const MlpForward& a, const float* transposed, size_t n, size_t first, BlockBuffers& buffers) {
  const MlpShape& shape = a.shape;
  const int rows = static_cast<int>(std::min<size_t>(kRows, n - first));
  Numbers x = blockNumbers(a.input, hostPointer(a.input.data), first, rows, shape.layerInputs(0), buffers.input);
  float* activations = hostPointer(a.activations);
  for (int l = 0; l < shape.hiddenLayers; ++l) {
    float* h = buffers.hidden[l % 2];
    float* keep =
        activations ? activations + (static_cast<size_t>(l) * a.samples.capacity + first) * shape.width : nullptr;
    if (keep && rows == kRows) h = keep;
    product<Finish::relu>(x, transposed + shape.weightOffset(l), shape.layerInputs(l), shape.width, h, shape.width);
    if (keep && h != keep) std::memcpy(keep, h, sizeof(float) * rows * shape.width);
    x = rowMajor(h, shape.width);
  }
  const int last = shape.hiddenLayers, outputs = shape.layerOutputs(last);
  const bool inPlace = rows == kRows && a.output.columns == static_cast<uint32_t>(outputs);
  float* y = inPlace ? hostPointer(a.output.data) + first * a.output.rowStride : buffers.output;
  const size_t yRow = inPlace ? a.output.rowStride : outputs;
  product<Finish::none>(x, transposed + shape.weightOffset(last), shape.width, outputs, y, yRow);
  if (shape.activation == OutputActivation::sigmoid) {
    for (int r = 0; r < kRows; ++r) sigmoidRow(y + r * yRow, outputs);
  }
  if (!inPlace) unpackRows(y, outputs, a.output, hostPointer(a.output.data), first, rows);
}

// dY of a block: the given gradients multiplied by the derivative of the output activation; zero in padding.
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
  const Numbers input =
      blockNumbers(a.input, hostPointer(a.input.data), first, rows, shape.layerInputs(0), buffers.input);
  const float* activations = hostPointer(a.activations);
  outputGradientBlock(a, first, rows, buffers.output);
  const float* dy = buffers.output;
  for (int l = shape.hiddenLayers; l > 0; --l) {
    const int outputs = shape.layerOutputs(l), width = shape.width;
    const Numbers upstream = rowMajor(dy, outputs);
    const float* h = activations + (static_cast<size_t>(l - 1) * a.samples.capacity + first) * width;
    if (rows < kRows) {
      std::memcpy(buffers.hidden[0], h, sizeof(float) * rows * width);
      std::memset(buffers.hidden[0] + rows * width, 0, sizeof(float) * (kRows - rows) * width);
      h = buffers.hidden[0];
    }
    // The padding columns of the last layer are zero, and most of them are skipped.
    const int real = l == shape.hiddenLayers ? (shape.outputs + 3) / 4 * 4 : outputs;
    float* dh = buffers.gradient[l % 2];
    if (weightGradients) outer(upstream, real, h, width, width, weightGradients + shape.weightOffset(l));
    product<Finish::maskByActivation>(upstream, weights + shape.weightOffset(l), real, width, dh, width, h, width);
    dy = dh;
  }
  // The gradients of the first layer are [inputs][outputs], unlike those of the others, so that the input may have any
  // layout.
  const int outputs = shape.layerOutputs(0), inputs = shape.layerInputs(0);
  if (weightGradients) outer(input, inputs, dy, outputs, outputs, weightGradients);
  if (!a.inputGradients) return;
  float* dx = buffers.gradient[0];
  product<Finish::none>(rowMajor(dy, outputs), weights, outputs, inputs, dx, inputs);
  unpackRows(dx, inputs, a.inputGradients, hostPointer(a.inputGradients.data), first, rows);
}

// first[i] += first[i + stride] + first[i + 2 stride] + ... over `parts` rows, in order; `count` is a multiple of 16.
void sumOfParts(float* first, size_t parts, size_t stride, size_t count) {
  const Float d;
  for (size_t i = 0; i < count; i += hn::Lanes(d)) {
    Vector sum = hn::LoadU(d, first + i);
    for (size_t part = 1; part < parts; ++part) sum = hn::Add(sum, hn::LoadU(d, first + part * stride + i));
    hn::StoreU(sum, d, first + i);
  }
}

}  // namespace tessera::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace tessera::cpu {

HWY_EXPORT(forwardBlock);
HWY_EXPORT(backwardBlock);
HWY_EXPORT(sumOfParts);

namespace {

void checkShape(const MlpShape& shape) {
  CHECK((shape.width == 16 || shape.width == 32 || shape.width == 64 || shape.width == 128));
  CHECK(shape.hiddenLayers >= 1);
  CHECK(shape.inputs <= kMaxWidth);
  CHECK(shape.outputs <= kMaxWidth);
}

// Transposes the weights of each layer from [outputs][inputs] to [inputs][outputs].
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

// Reused between calls: fresh pages would cost a third of the time of a batch of 8192 samples.
float* partialGradients(size_t count) {
  thread_local std::vector<float> partial;
  if (partial.size() < count) partial.resize(count);
  return partial.data();
}

}  // namespace

void run(Context& context, const MlpForward& a) {
  checkShape(a.shape);
  CHECK(a.output.groupWidth == 0u);
  CHECK(a.output.columns <= static_cast<uint32_t>(a.shape.outputs));
  const HostRows rows = hostRows(a.samples);
  if (rows.count() == 0) return;
  const size_t blocks = (rows.count() + kRows - 1) / kRows;
  const std::vector<float> transposed = transposeLayers(a.shape, hostPointer(a.weights));
  const auto block = HWY_DYNAMIC_DISPATCH(forwardBlock);
  context.pool.forRanges(blocks, 2, [&](size_t begin, size_t end) {
    for (size_t b = begin; b < end; ++b) block(a, transposed.data(), rows.end, rows.begin + b * kRows, threadBuffers());
  });
}

void run(Context& context, const MlpBackward& a) {
  checkShape(a.shape);
  const HostRows rows = hostRows(a.samples);
  const size_t blocks = (rows.count() + kRows - 1) / kRows, parameters = a.shape.parameters();
  if (rows.count() == 0) return;
  const size_t parts = std::min<size_t>(kParts, blocks);
  const auto block = HWY_DYNAMIC_DISPATCH(backwardBlock);
  if (!a.weightGradients) {
    context.pool.forRanges(blocks, 2, [&](size_t begin, size_t end) {
      for (size_t b = begin; b < end; ++b) block(a, rows.end, rows.begin + b * kRows, nullptr, threadBuffers());
    });
    return;
  }
  float* partial = partialGradients(parts * parameters);
  context.pool.run(parts, [&](size_t task, int) {
    const size_t part = parts - 1 - task;  // the last samples of the forward pass may still be in the cache
    float* gradients = partial + part * parameters;
    std::memset(gradients, 0, sizeof(float) * parameters);
    for (size_t b = part * blocks / parts; b < (part + 1) * blocks / parts; ++b) {
      block(a, rows.end, rows.begin + b * kRows, gradients, threadBuffers());
    }
  });
  const auto sumParts = HWY_DYNAMIC_DISPATCH(sumOfParts);
  float* sum = hostPointer(a.weightGradients);
  context.pool.run(a.shape.layers(), [&](size_t l, int) {
    const size_t inputs = a.shape.layerInputs(l), outputs = a.shape.layerOutputs(l), first = a.shape.weightOffset(l);
    sumParts(partial + first, parts, parameters, inputs * outputs);
    const float* from = partial + first;
    float* to = sum + first;
    if (l > 0) {
      for (size_t i = 0; i < inputs * outputs; ++i) to[i] += from[i];
    } else {  // [inputs][outputs], see backwardBlock
      for (size_t o = 0; o < outputs; ++o) {
        for (size_t i = 0; i < inputs; ++i) to[o * inputs + i] += from[i * outputs + o];
      }
    }
  });
}

}  // namespace tessera::cpu
#endif
