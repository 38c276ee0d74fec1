// The list of all operations, for code that needs all of them: the tables of the devices, and device_test.cpp, which
// tests every operation on every device. Any other file that includes this is rebuilt for every new operation.
#pragma once

#include "compute/adam.h"
#include "compute/attention.h"
#include "compute/blend.h"
#include "compute/block_march.h"
#include "compute/blocks.h"
#include "compute/composite.h"
#include "compute/cube_map.h"
#include "compute/deferred.h"
#include "compute/encodings.h"
#include "compute/exposure.h"
#include "compute/hash_grid.h"
#include "compute/lattice.h"
#include "compute/losses.h"
#include "compute/mlp.h"
#include "compute/occupancy.h"
#include "compute/octahedra.h"
#include "compute/operation.h"
#include "compute/patches.h"
#include "compute/proposals.h"
#include "compute/rays.h"
#include "compute/rows.h"
#include "compute/virtual_grid.h"

namespace tessera {

// X(argument struct): every operation, in the order of the headers.
#define TESSERA_OPERATIONS(X)   \
  X(HashGridForward)            \
  X(HashGridBackward)           \
  X(MlpForward)                 \
  X(MlpBackward)                \
  X(SphericalHarmonicsForward)  \
  X(SphericalHarmonicsBackward) \
  X(FrequencyForward)           \
  X(FrequencyBackward)          \
  X(GenerateRays)               \
  X(MarchRays)                  \
  X(OpticalDepth)               \
  X(CompactSamples)             \
  X(GatherRows)                 \
  X(OccupancyPoints)            \
  X(OccupancyUpdate)            \
  X(OccupancySamples)           \
  X(TraceOctahedra)             \
  X(OctahedraBackward)          \
  X(MergeOctahedra)             \
  X(DistinctTexels)             \
  X(VirtualGridForward)         \
  X(VirtualGridBackward)        \
  X(LatticeForward)             \
  X(LatticeBackward)            \
  X(AttentionForward)           \
  X(AttentionBackward)          \
  X(EnterScene)                 \
  X(MarchBlocks)                \
  X(BlockSamples)               \
  X(BlockPoints)                \
  X(GroupByBlock)               \
  X(ScatterRows)                \
  X(ResampleFences)             \
  X(InterlevelLoss)             \
  X(CompositeForward)           \
  X(CompositeBackward)          \
  X(OpaqueForward)              \
  X(OpaqueBackward)             \
  X(DeferredForward)            \
  X(DeferredBackward)           \
  X(BlendForward)               \
  X(BlendBackward)              \
  X(ShadeForward)               \
  X(ShadeBackward)              \
  X(AddColumns)                 \
  X(ColourLoss)                 \
  X(DistortionLoss)             \
  X(DepthLoss)                  \
  X(S3imLoss)                   \
  X(OpacityLoss)                \
  X(SparsityLoss)               \
  X(ExposureForward)            \
  X(ExposureBackward)           \
  X(CubeMapForward)             \
  X(CubeMapBackward)            \
  X(PatchTexels)                \
  X(DistinctRows)               \
  X(StoreTexelsForward)         \
  X(StoreTexelsBackward)        \
  X(MixRowsForward)             \
  X(MixRowsBackward)            \
  X(DitherLoss)                 \
  X(Adam)

inline constexpr OperationId kAllOperations[] = {
#define TESSERA_ID(name) kOperation<name>,
    TESSERA_OPERATIONS(TESSERA_ID)
#undef TESSERA_ID
};

// Calls `run` with `arguments` as the struct that `operation` identifies. Returns false if it is not on the list.
template <class Run>
bool dispatchOperation(const OperationId& operation, const void* arguments, const Run& run) {
  switch (operation.hash()) {
#define TESSERA_CASE(name)                     \
  case kOperation<name>.hash():                \
    run(*static_cast<const name*>(arguments)); \
    return true;
    TESSERA_OPERATIONS(TESSERA_CASE)
#undef TESSERA_CASE
  }
  return false;
}

}  // namespace tessera
