#include "compute/rows.h"

#include "compute/vulkan/vulkan_device.h"
#include "shaders/add_columns.h"
#include "shaders/compute/arguments_attention.h"
#include "shaders/compute/arguments_rays.h"
#include "shaders/move_rows.h"

namespace tessera {

namespace {

constexpr uint32_t kElementsPerGroup = 256;  // local_size_x of the kernel that moves rows

}  // namespace

void VulkanDevice::moveRows(const Count& rows, const Slice<const uint32_t>& source, const Matrix<const float>& from,
                            const Matrix<const float>& to, bool scatter) {
  CHECK(from.columns == to.columns);
  arguments::MoveRowsArguments arguments = {};
  arguments.rows = countArguments(rows);
  arguments.source = deviceAddress(source);
  arguments.from = matrixArguments(from, scatter ? rows.capacity : 0);
  arguments.to = matrixArguments(to, scatter ? 0 : rows.capacity);
  requireIndexable(size_t{rows.capacity} * from.columns);
  queue(kernel(kMoveRowsSpirv, {scatter}), arguments, countGroups(rows, kElementsPerGroup, from.columns));
  countedGroups_.changed(arguments.to.data, to.data.count * sizeof(float));  // counters may be moved as floats
}

template <>
void VulkanDevice::enqueue(const GatherRows& options) {
  moveRows(options.rows, options.source, options.input, options.output, false);
}

template <>
void VulkanDevice::enqueue(const ScatterRows& options) {
  moveRows(options.rows, options.source, options.input, options.output, true);
}

template <>
void VulkanDevice::enqueue(const AddColumns& options) {
  const size_t rows = options.rows.capacity;
  CHECK(options.input.columns == options.output.columns);
  arguments::AddColumnsArguments arguments = {};
  arguments.rows = countArguments(options.rows);
  arguments.added = matrixArguments(options.input, rows);
  arguments.sums = matrixArguments(options.output, rows);
  queue(kernel(kAddColumnsSpirv), arguments, countGroups(options.rows, 256, options.output.columns));
}

}  // namespace tessera
