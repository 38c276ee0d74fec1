#include "representations/mesh/train/mesh_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "base/error.h"
#include "representations/mesh/testing/small_mesh.h"

namespace tessera {
namespace {

TEST(MeshModel, RefusesAnImpossibleCoverage) {
  const MeshPart part{"block_0_0", 0, {}, {1, 1, 1}};
  const auto read = [&](const std::vector<uint32_t>& numbers) {
    TensorSet tensors;
    tensors.add("atlas.coverage", numbers);
    return readCoverage(part, "state", *decodeSafetensors(tensors.encode({})));
  };
  EXPECT_EQ(read({9, 2}), (SurfaceCoverage{"block_0_0", 9, 2}));
  for (const std::vector<uint32_t>& numbers : std::vector<std::vector<uint32_t>>{{9}, {9, 10}, {0, 0}, {9, 2, 1}})
    EXPECT_THROW(read(numbers), Error);
  EXPECT_FALSE(readCoverage(part, "state", *decodeSafetensors(TensorSet().encode({}))));
}

TEST(MeshModel, RefusesDamagedNumbers) {
  const auto device = makeDevice({"cpu", 1});
  const auto messageWith = [&](const std::function<Slice<float>(MeshModel&)>& numbers, float number) -> std::string {
    MeshModel model(*device, smallMeshConfig(), {"block_0_0", 0, {}, {1, 1, 1}});
    device->write(numbers(model).part(0, 1), std::span<const float>(&number, 1));
    TensorSet tensors;
    model.save(tensors, true);
    try {
      model.restore("state", *decodeSafetensors(tensors.encode({})));
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const auto displacements = [](MeshModel& model) { return model.level(0).displacements().values.all(); };
  const auto table = [](MeshModel& model) { return model.field().table().values.all(); };
  EXPECT_EQ(messageWith(displacements, kMaxDisplacement), "");
  EXPECT_NE(messageWith(displacements, 0.6f).find("outside of its cell"), std::string::npos);
  EXPECT_NE(messageWith(displacements, NAN).find("outside of its cell"), std::string::npos);
  EXPECT_EQ(messageWith(table, 0.5f), "");
  EXPECT_NE(messageWith(table, INFINITY).find("not finite"), std::string::npos);
}

TEST(MeshModel, HasOnlyQuadsIfRequested) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.quads = true;
  MeshModel model(*device, config, {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  // The vertices are in the middles of cells, so a ray straight down meets one quad in each layer of cells.
  const Array<float> origins = device->uploadArray(std::vector<float>{0.07f, 0.05f, 3}),
                     directions = device->uploadArray(std::vector<float>{0, 0, -1});
  const uint32_t layers = static_cast<uint32_t>(config.meshCells);
  MeshHits hits(*device, 1, 4 * layers);
  Array<uint32_t> counters = device->array<uint32_t>(MeshHits::kCounters);
  hits.counters = counters;
  const auto trace = [&] {
    level.trace({1, origins, directions, {}}, 4 * layers, false, hits);
    return device->read(counters.all())[0];
  };
  ASSERT_EQ(trace(), layers);
  const FaceSet quads = FaceSet::quads(level.domain().grids);
  for (const uint32_t face : device->read(hits.faces.part(0, layers))) EXPECT_TRUE(quads.contains(face));
  FaceSet one(level.domain().grids);
  one.add(device->read(hits.faces.part(0, 1))[0]);
  level.limitToFaces(one);
  EXPECT_EQ(trace(), 1u);
  level.removeLimit();
  EXPECT_EQ(trace(), layers) << "not the other faces of octahedra";
}

TEST(MeshModel, EmptiesTheCellsThatNoRayReaches) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.opacityOffset = 0;
  config.everyCell = true;
  MeshModel model(*device, config, {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  level.exclude(std::vector<bool>(level.domain().grids[0].cells(), true));
  // One ray straight down through the middle of a column of cells, whose first hit is opaque and the second is not.
  const Array<float> origins = device->uploadArray(std::vector<float>{0.07f, 0.05f, 3}),
                     directions = device->uploadArray(std::vector<float>{0, 0, -1});
  const MeshRays rays{1, origins, directions, {}};
  constexpr uint32_t kMaxHits = 200;
  MeshHits hits(*device, 1, kMaxHits);
  Array<uint32_t> counters = device->array<uint32_t>(MeshHits::kCounters);
  hits.counters = counters;
  std::vector<float> logits(kMaxHits, 5);
  logits[0] = 0;  // half opaque; the second hit leaves a transmittance below a hundredth
  const Array<float> opacities = device->uploadArray(logits);
  level.trace(rays, kMaxHits, false, hits);
  const uint32_t all = device->read(counters.all())[0];
  ASSERT_GT(all, 20u);
  const std::vector<float> positions = device->read(hits.positions.part(0, size_t{3} * all));
  for (int update = 0; update < 40; ++update) {
    level.addOccupancy(rays, hits, Matrix<const float>(opacities.all(), 1));
    level.refreshOccupancy(true);
  }
  std::vector<uint32_t> expected(level.domain().grids[0].words());
  for (const uint32_t reached : {0u, 1u}) {
    uint32_t cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const uint32_t n = static_cast<uint32_t>(config.meshCells);
      cell = cell * n + static_cast<uint32_t>(positions[3 * size_t{reached} + axis] * static_cast<float>(n));
    }
    expected[cell / 32] |= 1u << cell % 32;
  }
  EXPECT_EQ(level.occupancy().bitWords(), expected);
  level.trace(rays, kMaxHits, false, hits);
  EXPECT_LT(device->read(counters.all())[0], all / 2) << "hits beyond the surface and its neighbours";
}

TEST(MeshModel, DilatesCellsByOneInAllDirections) {
  constexpr uint32_t kCells = 6;
  std::vector<uint32_t> bits((kCells * kCells * kCells + 31) / 32);
  const auto index = [](uint32_t x, uint32_t y, uint32_t z) { return x + kCells * (y + kCells * z); };
  for (const uint32_t cell : {index(2, 3, 3), index(5, 0, 0)}) bits[cell / 32] |= 1u << cell % 32;
  const std::vector<uint32_t> dilated = dilateCells(bits, kCells);
  for (uint32_t z = 0; z < kCells; ++z)
    for (uint32_t y = 0; y < kCells; ++y)
      for (uint32_t x = 0; x < kCells; ++x) {
        const bool beside = (x >= 1 && x <= 3 && y >= 2 && y <= 4 && z >= 2 && z <= 4) || (x >= 4 && y <= 1 && z <= 1);
        EXPECT_EQ(dilated[index(x, y, z) / 32] >> index(x, y, z) % 32 & 1, beside) << x << " " << y << " " << z;
      }
}

}  // namespace
}  // namespace tessera
