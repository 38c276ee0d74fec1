#include "train/occupancy_grid.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

constexpr int kResolution = 8;
constexpr uint32_t kCells = kResolution * kResolution * kResolution;

MarchSpace boundedSpace() {
  MarchSpace space;
  space.contracted = false;
  space.gridResolution = kResolution;
  space.minStep = 0.01f;
  return space;
}

// A field that is dense where the first coordinate is below a half, and empty elsewhere.
class HalfFull {
 public:
  explicit HalfFull(Device& device) : device_(device) {}

  void operator()(Count count, Slice<const float> positions, Matrix<float> logDensities) {
    const std::vector<float> at = device_.read(positions);
    std::vector<float> answer(count.capacity);
    for (uint32_t i = 0; i < count.capacity; ++i) answer[i] = at[3 * size_t{i}] < 0.5f ? 6.0f : -20.0f;
    device_.write(logDensities.data, std::span<const float>(answer));
    largestChunk = std::max(largestChunk, count.capacity);
    asked += count.capacity;
  }

  uint32_t largestChunk = 0, asked = 0;

 private:
  Device& device_;
};

int wrongCells(OccupancyGrid& grid) {
  const std::vector<uint32_t> bits = grid.bitWords();
  int wrong = 0;
  for (uint32_t cell = 0; cell < kCells; ++cell) {
    const bool set = bits[cell / 32] >> (cell % 32) & 1;
    wrong += set != (cell % kResolution < kResolution / 2);
  }
  return wrong;
}

TEST(OccupancyGrid, StartsWithAllCellsOccupied) {
  const std::unique_ptr<Device> device = makeDevice({"reference", 0});
  OccupancyGrid grid(*device, boundedSpace());
  EXPECT_EQ(grid.cells(), kCells);
  EXPECT_EQ(grid.occupiedFraction(), 1);
}

TEST(OccupancyGrid, LearnsFromAllCellsWhereTheFieldIsDense) {
  for (const char* kind : {"reference", "cpu"}) {
    const std::unique_ptr<Device> device = makeDevice({kind, 2});
    OccupancyGrid grid(*device, boundedSpace());
    HalfFull field(*device);
    grid.update(std::ref(field), kCells, 0, 1, 100);  // the chunk size does not divide the number of cells
    EXPECT_EQ(wrongCells(grid), 0) << kind;
    EXPECT_EQ(grid.occupiedFraction(), 0.5);
    EXPECT_EQ(field.asked, kCells);
    EXPECT_EQ(field.largestChunk, 100u);
  }
}

TEST(OccupancyGrid, ConvergesWithPartialUpdates) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  OccupancyGrid grid(*device, boundedSpace());
  HalfFull field(*device);
  grid.update(std::ref(field), kCells / 8, kCells / 8, 0, 1 << 16);
  EXPECT_EQ(field.asked, kCells / 4);
  for (uint64_t update = 1; update < 60; ++update) {
    grid.update(std::ref(field), kCells / 8, kCells / 8, update, 1 << 16);
  }
  EXPECT_EQ(wrongCells(grid), 0);
}

TEST(OccupancyGrid, ClearsCellsThatHaveBecomeEmpty) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  OccupancyGrid grid(*device, boundedSpace());
  HalfFull field(*device);
  grid.update(std::ref(field), kCells, 0, 0, 1 << 16);
  ASSERT_EQ(grid.occupiedFraction(), 0.5);
  const std::vector<float> empty(kCells, -20.0f);
  for (uint64_t update = 1; update < 200; ++update) {
    grid.update([&](Count, Slice<const float>, Matrix<float> to) { device->write(to.data, std::span(empty)); }, kCells,
                0, update, 1 << 16);
  }
  const std::vector<float> values = grid.values();
  for (const float value : values) EXPECT_LT(value, 0.01f);
}

TEST(OccupancyGrid, NeverEvaluatesInvisibleCells) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  OccupancyGrid grid(*device, boundedSpace());
  std::vector<bool> visible(kCells);
  for (uint32_t cell = 0; cell < kCells; ++cell) visible[cell] = cell % kResolution >= kResolution / 2 - 1;
  grid.exclude(visible);
  EXPECT_EQ(grid.visibleCells(), kCells / kResolution * 5);
  HalfFull field(*device);
  const auto inVisible = [&](Count count, Slice<const float> positions, Matrix<float> logDensities) {
    const std::vector<float> at = device->read(positions);
    for (size_t i = 0; i < at.size(); i += 3) EXPECT_GE(at[i] * kResolution, kResolution / 2 - 1);
    field(count, positions, logDensities);
  };
  grid.update(inVisible, grid.visibleCells(), 0, 1, 1 << 16);
  EXPECT_EQ(field.asked, grid.visibleCells());
  grid.update(inVisible, 50, 50, 2, 1 << 16);
  EXPECT_EQ(grid.occupiedFraction(), 1.0 / kResolution);  // dense and visible: one layer
}

TEST(OccupancyGrid, IsRestoredExactly) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  OccupancyGrid grid(*device, boundedSpace()), restored(*device, boundedSpace());
  HalfFull field(*device);
  grid.update(std::ref(field), kCells, 0, 1, 1 << 16);
  restored.restore(grid.values(), grid.bitWords());
  EXPECT_EQ(restored.values(), grid.values());
  EXPECT_EQ(restored.bitWords(), grid.bitWords());
  for (OccupancyGrid* each : {&grid, &restored}) each->update(std::ref(field), 64, 64, 9, 1 << 16);
  EXPECT_EQ(restored.values(), grid.values());
}

}  // namespace
}  // namespace tessera
