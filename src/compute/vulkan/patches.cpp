#include "compute/patches.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/compute/arguments_patches.h"
#include "shaders/distinct_rows_list.h"
#include "shaders/distinct_rows_mark.h"
#include "shaders/distinct_rows_number.h"
#include "shaders/mix_rows_backward.h"
#include "shaders/mix_rows_backward_float_atomics.h"
#include "shaders/mix_rows_forward.h"
#include "shaders/patch_texels.h"
#include "shaders/store_texels_backward.h"
#include "shaders/store_texels_forward.h"

namespace tessera {

namespace {

// local_size_x of the kernels with one invocation per number or id, and of those with one per hit or row.
constexpr uint32_t kPatchNumbersPerGroup = 256, kPatchRowsPerGroup = 128;

template <class Options>
arguments::MixRowsArguments mixRowsArguments(const VulkanDevice& device, const Options& options) {
  requireIndexable(size_t{options.samples.capacity} * options.perSample);
  arguments::MixRowsArguments arguments = {};
  arguments.samples = device.countArguments(options.samples);
  arguments.inputRows = device.countArguments(options.inputRows);
  arguments.rows = deviceAddress(options.rows);
  arguments.weights = deviceAddress(options.weights);
  arguments.perSample = options.perSample;
  return arguments;
}

template <class Options>
arguments::StoreTexelsArguments storeTexelsArguments(const VulkanDevice& device, const Options& options) {
  CHECK(options.features.columns == StoreTexelsForward::kFeatures);
  requireIndexable(size_t{options.rows.capacity} * StoreTexelsForward::kStored);
  arguments::StoreTexelsArguments arguments = {};
  arguments.rows = device.countArguments(options.rows);
  arguments.offset = options.offset;
  arguments.features = matrixArguments(options.features, options.rows.capacity);
  arguments.ranges = deviceAddress(options.ranges);
  return arguments;
}

}  // namespace

template <>
void VulkanDevice::enqueue(const PatchTexels& options) {
  CHECK((options.patchEdge >= 2u && options.patchEdge <= 64u));
  requireIndexable(size_t{4} * options.samples.capacity);
  arguments::PatchTexelsArguments arguments = {};
  arguments.samples = countArguments(options.samples);
  arguments.patchOfFace = deviceAddress(options.patchOfFace);
  arguments.faces = deviceAddress(options.faces);
  arguments.barycentrics = deviceAddress(options.barycentrics);
  arguments.cornerFactors = deviceAddress(options.cornerFactors);
  arguments.texels = deviceAddress(options.texels);
  arguments.weights = deviceAddress(options.weights);
  arguments.patchEdge = options.patchEdge;
  queue(kernel(kPatchTexelsSpirv), arguments, countGroups(options.samples, kPatchRowsPerGroup));
}

template <>
void VulkanDevice::enqueue(const DistinctRows& options) {
  const uint32_t words = options.words();
  requireIndexable(options.idCount);
  requireIndexable(size_t{options.samples.capacity} * options.perSample);
  arguments::DistinctRowsArguments arguments = {};
  arguments.samples = countArguments(options.samples);
  arguments.ids = deviceAddress(options.ids);
  arguments.marks = deviceAddress(options.marks);
  arguments.ranks = deviceAddress(options.ranks);
  arguments.rowIds = deviceAddress(options.rowIds);
  arguments.rows = deviceAddress(options.rows);
  arguments.perSample = options.perSample;
  arguments.idCount = options.idCount;
  arguments.rowCapacity = options.rowCapacity;
  arguments.words = words;
  const auto countIdGroups = [&] { return countGroups(options.samples, kPatchNumbersPerGroup, options.perSample); };
  if (words > 0) fillZero(options.marks.part(0, words));
  queue(kernel(kDistinctRowsMarkSpirv), arguments, countIdGroups());
  const uint64_t fitting = scratch(2 + scanScratch(words));
  queueRunningSums({.rows = {words},
                    .values = arguments.ranks,
                    .total = deviceAddress(options.rowCount),
                    .fitting = fitting,
                    .limit = kNoLimit,
                    .scratch = fitting + 2 * sizeof(uint32_t),
                    .marks = arguments.marks});
  queue(kernel(kDistinctRowsListSpirv), arguments, {groups(words, kPatchRowsPerGroup)});
  queue(kernel(kDistinctRowsNumberSpirv), arguments, countIdGroups());
  countersChanged(options.rowCount);
}

template <>
void VulkanDevice::enqueue(const StoreTexelsForward& options) {
  CHECK(options.stored.columns == StoreTexelsForward::kStored);
  arguments::StoreTexelsArguments arguments = storeTexelsArguments(*this, options);
  arguments.opaqueFrom = options.opaqueFrom;
  arguments.transparentBelow = options.transparentBelow;
  arguments.stored = matrixArguments(options.stored, options.rows.capacity);
  queue(kernel(kStoreTexelsForwardSpirv), arguments,
        countGroups(options.rows, kPatchNumbersPerGroup, StoreTexelsForward::kStored));
}

template <>
void VulkanDevice::enqueue(const StoreTexelsBackward& options) {
  CHECK(options.storedGradients.columns == StoreTexelsForward::kStored);
  CHECK(options.featureGradients.columns == StoreTexelsForward::kFeatures);
  arguments::StoreTexelsArguments arguments = storeTexelsArguments(*this, options);
  arguments.stored = matrixArguments(options.storedGradients, options.rows.capacity);
  arguments.featureGradients = matrixArguments(options.featureGradients, options.rows.capacity);
  queue(kernel(kStoreTexelsBackwardSpirv), arguments,
        countGroups(options.rows, kPatchNumbersPerGroup, StoreTexelsForward::kFeatures));
}

template <>
void VulkanDevice::enqueue(const MixRowsForward& options) {
  const uint32_t columns = options.output.columns;
  CHECK(options.input.columns == columns);
  requireIndexable(size_t{options.samples.capacity} * columns);
  arguments::MixRowsArguments arguments = mixRowsArguments(*this, options);
  arguments.source = matrixArguments(options.input, options.inputRows.capacity);
  arguments.mixed = matrixArguments(options.output, options.samples.capacity);
  queue(kernel(kMixRowsForwardSpirv), arguments, countGroups(options.samples, kPatchNumbersPerGroup, columns));
}

template <>
void VulkanDevice::enqueue(const MixRowsBackward& options) {
  CHECK(options.outputGradients.columns == options.inputGradients.columns);
  arguments::MixRowsArguments arguments = mixRowsArguments(*this, options);
  arguments.source = matrixArguments(options.inputGradients, options.inputRows.capacity);
  arguments.mixed = matrixArguments(options.outputGradients, options.samples.capacity);
  queue(sumKernel(kMixRowsBackwardFloatAtomicsSpirv, kMixRowsBackwardSpirv), arguments,
        countGroups(options.samples, kPatchRowsPerGroup, options.perSample));
}

}  // namespace tessera
