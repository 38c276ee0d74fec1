// One workgroup takes a block of samples through a layer: `state` holds the block's vectors, the layer's weights pass
// through `weightTile` sixteen rows at a time, and each invocation sums kRows samples × kColumns neurons in registers.
// Defines: state, sums, FOR_EACH_BLOCK(), stateRow(), stateColumn(), clearSums(), accumulate().

const uint kThreads = 128;
const uint kRowGroups = 16;
const uint kColumnGroups = kThreads / kRowGroups;
const uint kDepth = 16;

layout(local_size_x = 128) in;
layout(constant_id = 0) const uint kWidth = 64;       // of the hidden layers
layout(constant_id = 1) const uint kBlock = 64;       // samples of a workgroup, a multiple of 16
layout(constant_id = 2) const uint kStateWidth = 64;  // at least kWidth

const uint kRows = kBlock / kRowGroups;
const uint kColumns = kWidth / kColumnGroups;
const uint kStride = kStateWidth + 1;  // odd, so that neighbouring samples lie in different banks

shared float state[kBlock * kStride];
shared float weightTile[kDepth * kWidth];
float sums[kRows * kColumns];

// The sample (within the block) and the neuron of this invocation's sum (r, c).
uint stateRow(uint r) { return r * kRowGroups + gl_LocalInvocationIndex % kRowGroups; }
uint stateColumn(uint c) { return gl_LocalInvocationIndex / kRowGroups * kColumns + c; }

// The first sample of every block of samples [begin, end), shared out among the workgroups.
#define FOR_EACH_BLOCK(firstSample, begin, end)                                     \
  for (uint firstSample = (begin) + gl_WorkGroupID.x * kBlock; firstSample < (end); \
       firstSample += gl_NumWorkGroups.x * kBlock)

void clearSums() {
  [[unroll]] for (uint i = 0; i < kRows * kColumns; ++i) sums[i] = 0;
}

// sums[sample][n] += Σ_{k < depth} state[sample][k] · weights[first + k · kStep + n · nStep] for n < columns; others add
// nothing. `depth` is a multiple of 16. All invocations call it together; it waits before it reads `state`.
void accumulate(FloatPointer weights, uint first, uint kStep, uint nStep, uint depth, uint columns) {
  for (uint k0 = 0; k0 < depth; k0 += kDepth) {
    barrier();
    for (uint i = gl_LocalInvocationIndex; i < kDepth * kWidth; i += kThreads) {
      // Neighbouring invocations read neighbouring weights.
      const uint k = kStep == 1 ? i % kDepth : i / kWidth;
      const uint n = kStep == 1 ? i / kDepth : i % kWidth;
      weightTile[k * kWidth + n] = n < columns ? weights.values[first + (k0 + k) * kStep + n * nStep] : 0;
    }
    barrier();
    for (uint k = 0; k < kDepth; ++k) {
      float column[kColumns];
      [[unroll]] for (uint c = 0; c < kColumns; ++c) column[c] = weightTile[k * kWidth + stateColumn(c)];
      [[unroll]] for (uint r = 0; r < kRows; ++r) {
        const float value = state[stateRow(r) * kStride + k0 + k];
        [[unroll]] for (uint c = 0; c < kColumns; ++c) sums[r * kColumns + c] += value * column[c];
      }
    }
  }
}
