// One workgroup computes a layer for a block of samples: `state` holds the block's vectors, the layer's weights are
// loaded into `weightTile` sixteen inputs at a time, and each invocation sums kRows samples × kColumns neurons in
// registers. Both are stored as vectors of four inputs, which reduces the number of loads to a quarter.
// Include after number.glsl. Defines the same as mlp_matrices.glsl: kThreads, kWidth, kBlock, STATE(), STATE_QUAD(),
// SET_STATE_QUAD(), clearSums(), accumulate(), storeSumsToState(), outputSums(), which calls the kernel's storeSum().

const uint kThreads = 128;
const uint kColumnGroups = 8;
const uint kRowGroups = kThreads / kColumnGroups;
const uint kDepth = 16;

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kWidth = 64;       // width of the hidden layers
layout(constant_id = 1) const uint kBlock = 64;       // samples per workgroup, a multiple of 16
layout(constant_id = 2) const uint kStateWidth = 64;  // at least kWidth

const uint kRows = kBlock / kRowGroups;
const uint kColumns = kWidth / kColumnGroups;
const uint kStride = kStateWidth / 4 + 1;   // in vectors of four; odd, so that neighbouring samples lie in different banks
const uint kTileStride = kDepth / 4 + 1;

shared NumberQuad state[kBlock * kStride];
shared NumberQuad weightTile[kWidth * kTileStride];
float sums[kRows * kColumns];

#define STATE(row, column) state[(row) * kStride + (column) / 4][(column) % 4]
#define STATE_QUAD(row, quad) state[(row) * kStride + (quad)]
#define SET_STATE_QUAD(row, quad, four) state[(row) * kStride + (quad)] = four

// Return the sample (within the block) and the neuron of this invocation's sum (r, c): neighbouring invocations have
// neighbouring neurons.
uint sumRow(uint r) { return r * kRowGroups + gl_LocalInvocationIndex / kColumnGroups; }
uint sumColumn(uint c) { return c * kColumnGroups + gl_LocalInvocationIndex % kColumnGroups; }

void clearSums() {
  [[unroll]] for (uint i = 0; i < kRows * kColumns; ++i) sums[i] = 0;
}

// Returns the weights of the inputs [k, k + 4) of neuron n.
NumberQuad loadWeightQuad(NumberPointer weights, uint first, uint kStep, uint nStep, uint k, uint n) {
  if (kStep == 1) return QuadPointer(weights).values[(first + k + n * nStep) / 4];
  NumberQuad four;
  [[unroll]] for (uint i = 0; i < 4; ++i) four[i] = weights.values[first + (k + i) * kStep + n * nStep];
  return four;
}

// sums[sample][n] += Σ_{k < depth} state[sample][k] · weights[first + k · kStep + n · nStep] for n < columns; the other
// sums do not change. One of the steps is 1; the other arguments are multiples of 16. All invocations must call it
// together; it has a barrier before it reads `state`.
void accumulate(NumberPointer weights, uint first, uint kStep, uint nStep, uint depth, uint columns) {
  for (uint k0 = 0; k0 < depth; k0 += kDepth) {
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < kWidth * kDepth / 4; i += kThreads) {
      // Neighbouring invocations read neighbouring weights.
      const uint quad = kStep == 1 ? i % (kDepth / 4) : i / kWidth;
      const uint n = kStep == 1 ? i / (kDepth / 4) : i % kWidth;
      weightTile[n * kTileStride + quad] =
          n < columns ? loadWeightQuad(weights, first, kStep, nStep, k0 + 4 * quad, n) : NumberQuad(0);
    }
    barrier();
    for (uint quad = 0; quad < kDepth / 4; ++quad) {
      vec4 column[kColumns];
      [[unroll]] for (uint c = 0; c < kColumns; ++c) column[c] = vec4(weightTile[sumColumn(c) * kTileStride + quad]);
      [[unroll]] for (uint r = 0; r < kRows; ++r) {
        const vec4 value = vec4(state[sumRow(r) * kStride + k0 / 4 + quad]);
        [[unroll]] for (uint i = 0; i < 4; ++i) {
          [[unroll]] for (uint c = 0; c < kColumns; ++c) sums[r * kColumns + c] += value[i] * column[c][i];
        }
      }
    }
  }
}

// Stores the sums in `state`, with ReLU if `rectified`. It has a barrier before the writes, but not after.
void storeSumsToState(bool rectified) {
  barrier();
  [[unroll]] for (uint r = 0; r < kRows; ++r) {
    [[unroll]] for (uint c = 0; c < kColumns; ++c) {
      const float sum = sums[r * kColumns + c];
      STATE(sumRow(r), sumColumn(c)) = toNumber(rectified ? atLeast(sum, 0) : sum);
    }
  }
}

// Passes each sum to the kernel.
void storeSum(uint row, uint column, float sum);
void outputSums(uint firstRow, uint firstColumn) {
  [[unroll]] for (uint c = 0; c < kColumns; ++c) {
    [[unroll]] for (uint r = 0; r < kRows; ++r) {
      storeSum(firstRow + sumRow(r), firstColumn + sumColumn(c), sums[r * kColumns + c]);
    }
  }
}
