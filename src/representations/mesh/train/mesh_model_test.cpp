#include "representations/mesh/train/mesh_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/random.h"
#include "compute/composite.h"
#include "field/testing/expect_gradients.h"
#include "representations/mesh/testing/small_mesh.h"

namespace tessera {
namespace {

// A ray straight down beside the middle of a block, and its hits.
class RayDown {
 public:
  static constexpr uint32_t kMaxHits = 200;
  MeshHits hits;

  RayDown(Device& device, float height)
      : hits(device, 1, kMaxHits),
        device_(device),
        origin_(device.uploadArray(std::vector<float>{0.07f, 0.05f, height})),
        direction_(device.uploadArray(std::vector<float>{0, 0, -1})),
        counters_(device.array<uint32_t>(MeshHits::kCounters)) {
    hits.counters = counters_;
  }
  MeshRays rays() const { return {1, origin_, direction_, {}}; }
  // Returns the number of hits.
  uint32_t trace(MeshLevel& level) {
    level.trace(rays(), kMaxHits, false, hits);
    return device_.read(counters_.all())[0];
  }

 private:
  Device& device_;
  Array<float> origin_, direction_;
  Array<uint32_t> counters_;
};

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
  EXPECT_NE(messageWith(displacements, 0.5f).find("outside of its cell"), std::string::npos);
  EXPECT_NE(messageWith(displacements, 0.6f).find("outside of its cell"), std::string::npos);
  EXPECT_NE(messageWith(displacements, NAN).find("outside of its cell"), std::string::npos);
  EXPECT_EQ(messageWith(table, 0.5f), "");
  EXPECT_NE(messageWith(table, INFINITY).find("not finite"), std::string::npos);
}

TEST(MeshModel, RefusesFeaturesThatNoSceneCanHold) {
  const auto device = makeDevice({"cpu", 1});
  const MeshPart part{"block_0_0", 0, {}, {1, 1, 1}};
  const auto isRead = [&](float largest) {
    MeshModel model(*device, smallMeshConfig(), part), again(*device, smallMeshConfig(), part);
    MeshAtlas atlas;
    atlas.patchEdge = 8;
    atlas.faces = FaceSet(model.level(0).domain().grids);
    for (int f = 0; f < MeshField::kFeatures; ++f) atlas.ranges.insert(atlas.ranges.end(), {-largest, largest});
    model.setAtlas(std::move(atlas));
    TensorSet tensors;
    model.save(tensors, true);
    try {
      again.restore("state", *decodeSafetensors(tensors.encode({})));
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("beyond what a scene can hold"), std::string::npos) << error.what();
      return false;
    }
    return true;
  };
  EXPECT_TRUE(isRead(1e6f));
  EXPECT_FALSE(isRead(1.1e6f));
}

TEST(MeshModel, HasOnlyQuadsIfRequested) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.quads = true;
  MeshModel model(*device, config, {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  // The vertices are in the middles of cells, so a ray straight down meets one quad in each layer of cells.
  RayDown ray(*device, 3);
  const uint32_t layers = static_cast<uint32_t>(config.meshCells);
  ASSERT_EQ(ray.trace(level), layers);
  const FaceSet quads = FaceSet::quads(level.domain().grids);
  for (const uint32_t face : device->read(ray.hits.faces.part(0, layers))) EXPECT_TRUE(quads.contains(face));
  FaceSet one(level.domain().grids);
  one.add(device->read(ray.hits.faces.part(0, 1))[0]);
  level.limitToFaces(one);
  EXPECT_EQ(ray.trace(level), 1u);
  level.removeLimit();
  EXPECT_EQ(ray.trace(level), layers) << "not the other faces of octahedra";
}

// The sum of random multiples of the colours of rays through octahedra with random vertices, on the reference device.
class ImageOfOctahedra {
 public:
  static constexpr uint32_t kRays = 16, kCapacity = 4096;
  const std::unique_ptr<Device> device = makeDevice({"reference", 1});
  MeshModel model{*device, config(), {"block_0_0", 0, {}, {1, 1, 1}}};
  MeshHits hits{*device, kRays, kCapacity};

  ImageOfOctahedra() {
    hits.counters = counters_;
    model.field().reserve(kCapacity);
    randomise(model.field().table(), 1);  // the initial values are so close to zero that they would have no effect
    randomise(model.level(0).displacements(), 0.4f);
    std::vector<float> origins, directions;
    for (uint32_t ray = 0; ray < kRays; ++ray) {
      origins.insert(origins.end(), {random(0.6f), random(0.6f), 3});
      directions.insert(directions.end(), {random(0.3f), random(0.3f), -1});
      for (int c = 0; c < 3; ++c) factors_.push_back(random(1));
    }
    origins_ = device->uploadArray(origins);
    directions_ = device->uploadArray(directions);
  }

  double sum() {
    model.level(0).trace(rays(), kCapacity, false, hits);
    output_ = model.field().forward(hits.samples(), hits.positions, directions_, hits.rayOfSample, true);
    CompositeForward composite;
    composite.extinction = Extinction::logit;
    composite.rays = {kRays};
    composite.firstSample = hits.firstSample;
    composite.x = output_.logits;
    composite.colours = output_.colours;
    composite.colour = colours_;
    composite.opacity = opacities_;
    composite.weights = weights_;
    device->run(composite);
    const std::vector<float> colours = device->read(colours_.all());
    double sum = 0;
    for (size_t i = 0; i < colours.size(); ++i) sum += double{factors_[i]} * colours[i];
    return sum;
  }
  // Adds the gradients of the sum to those of the vertices.
  void addGradients() {
    const Array<float> factors = device->uploadArray(factors_);
    CompositeBackward back;
    back.extinction = Extinction::logit;
    back.rays = {kRays};
    back.firstSample = hits.firstSample;
    back.x = output_.logits;
    back.colours = output_.colours;
    back.rayColourGradients = factors;
    back.xGradients = logitGradients_;
    back.colourGradients = Matrix<float>(colourGradients_, 3);
    device->run(back);
    model.field().backward(hits.samples(), hits.positions, logitGradients_, Matrix<const float>(colourGradients_, 3),
                           false, positionGradients_);
    model.level(0).backward(rays(), hits, positionGradients_);
  }
  // Adds the gradients of a function of the position of one hit alone.
  void addGradientsOfHit(uint32_t hit, const Vec3f& positionGradient) {
    std::vector<float> gradients(size_t{3} * kCapacity);
    for (size_t axis = 0; axis < 3; ++axis) gradients[size_t{3} * hit + axis] = positionGradient[axis];
    device->write(positionGradients_.all(), std::span<const float>(gradients));
    model.level(0).backward(rays(), hits, positionGradients_);
  }
  uint32_t countHits() { return device->read(counters_.all())[0]; }

 private:
  static MeshConfig config() {
    MeshConfig config = smallMeshConfig();
    config.meshCells = 8;
    config.gridLevels = 3;
    config.gridLog2Size = 8;
    config.gridBase = 3;
    config.gridFinest = 12;
    config.opacityOffset = config.minCosine = 0;
    return config;
  }
  float random(float most) { return most * (2 * random_.uniform(next_++) - 1); }
  void randomise(ParameterGroup& group, float most) {
    std::vector<float> values(group.values.size());
    for (float& value : values) value = random(most);
    device->write(group.values.all(), std::span<const float>(values));
  }
  MeshRays rays() const { return {kRays, origins_, directions_, {}}; }

  const RandomStream random_{11, 12};
  uint64_t next_ = 0;
  std::vector<float> factors_;
  MeshField::Output output_{};
  Array<float> origins_, directions_;
  Array<uint32_t> counters_ = device->array<uint32_t>(MeshHits::kCounters);
  Array<float> colours_ = device->array<float>(size_t{3} * kRays), opacities_ = device->array<float>(kRays),
               weights_ = device->array<float>(kCapacity), logitGradients_ = device->array<float>(kCapacity),
               colourGradients_ = device->array<float>(size_t{3} * kCapacity),
               positionGradients_ = device->array<float>(size_t{3} * kCapacity);
};

TEST(MeshModel, HasGradientsOfImagesThatAgreeWithFiniteDifferencesOfVertices) {
  ImageOfOctahedra image;
  image.sum();
  ASSERT_GT(image.countHits(), ImageOfOctahedra::kRays * 10);
  image.addGradients();
  expectGradientsOfDifferences(
      *image.device, image.model.level(0).displacements(), [&] { return image.sum(); }, 1e-4f);
}

// A vertex that moves within the plane of a face does not move the hits on the face.
TEST(MeshModel, GivesVerticesNoGradientAlongAFace) {
  ImageOfOctahedra image;
  image.sum();
  MeshLevel& level = image.model.level(0);
  const uint32_t n = level.domain().grids[0].resolution;
  const std::vector<uint32_t> faces = image.device->read(image.hits.faces.part(0, image.countHits()));
  const std::vector<float> displacements = image.device->read(level.displacements().values.all());
  for (uint32_t hit = 0; hit < faces.size(); hit += 7) {
    image.device->fillZero(level.displacements().gradients.all());
    image.addGradientsOfHit(hit, {0.3f, -0.8f, 0.5f});
    const std::vector<float> gradients = image.device->read(level.displacements().gradients.all());
    std::array<Vec3f, 3> corners, gradient;
    const uint32_t cell = faces[hit] / kFacesPerCell, place[3] = {cell % n, cell / n % n, cell / (n * n)};
    for (size_t k = 0; k < 3; ++k) {
      const auto offset = octahedronFace(faces[hit] % kFacesPerCell)[k];
      const auto vertex =
          static_cast<size_t>(int64_t{cell} + offset[0] + int64_t{n} * (offset[1] + int64_t{n} * offset[2]));
      for (size_t axis = 0; axis < 3; ++axis) {
        corners[k][axis] =
            static_cast<float>(place[axis]) + static_cast<float>(offset[axis]) + displacements[3 * vertex + axis];
        gradient[k][axis] = gradients[3 * vertex + axis];
      }
    }
    const Vec3f normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalized();
    const float largest = std::max({gradient[0].norm(), gradient[1].norm(), gradient[2].norm()});
    ASSERT_GT(largest, 0) << hit;
    for (const Vec3f& each : gradient) EXPECT_LT(each.cross(normal).norm(), 1e-4f * largest) << hit;
  }
}

TEST(MeshModel, EmptiesTheCellsThatNoRayReaches) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.opacityOffset = 0;
  config.everyCell = true;
  MeshModel model(*device, config, {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  level.exclude(std::vector<bool>(level.domain().grids[0].cells(), true));
  RayDown ray(*device, 3);  // through the middle of a column of cells
  std::vector<float> logits(RayDown::kMaxHits, 5);
  logits[0] = 0;  // half opaque; the second hit leaves a transmittance below a hundredth
  const Array<float> opacities = device->uploadArray(logits);
  const uint32_t all = ray.trace(level);
  ASSERT_GT(all, 20u);
  const std::vector<float> positions = device->read(ray.hits.positions.part(0, size_t{3} * all));
  for (int update = 0; update < 40; ++update) {
    level.addOccupancy(ray.rays(), ray.hits, Matrix<const float>(opacities.all(), 1));
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
  EXPECT_LT(ray.trace(level), all / 2) << "hits beyond the surface and its neighbours";
}

TEST(MeshModel, BeginsRaysAtADistanceInHalvesOfABlock) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.near = 1;
  MeshPart part{"block_0_0", 0, {}, {1, 1, 1}};
  part.halfBlockEdge = 0.5f;  // as of the background block of two blocks in a row
  MeshModel model(*device, config, part);
  RayDown ray(*device, 0.9f);
  ASSERT_GT(ray.trace(model.level(0)), 5u);
  const float first = device->read(ray.hits.distances.part(0, 1))[0];
  EXPECT_GE(first, 0.5f);
  EXPECT_LT(first, 0.7f);
}

TEST(MeshModel, KeepsItsCellsWhileAllAreEquallyTransparent) {
  const auto device = makeDevice({"cpu", 1});
  MeshModel model(*device, smallMeshConfig(), {"block_0_0", 0, {}, {1, 1, 1}});
  MeshLevel& level = model.level(0);
  const std::vector<uint32_t> all = level.tracedCells();
  for (int update = 0; update < 40; ++update) level.refreshOccupancy(false);
  EXPECT_EQ(level.tracedCells(), all);
}

TEST(MeshModel, HasCoarseVerticesThatItReadsAgain) {
  const auto device = makeDevice({"cpu", 1});
  MeshConfig config = smallMeshConfig();
  config.meshCells = 32;
  config.meshLevels = 3;
  config.opacityOffset = 0;
  const MeshPart part{"block_0_0", 0, {}, {1, 1, 1}};
  MeshModel model(*device, config, part);
  const std::vector<float> atTheLimit(model.level(0).displacements().values.size(), kMaxDisplacement);
  device->write(model.level(0).displacements().values.all(), std::span<const float>(atTheLimit));
  model.addCoarseLevels(1);
  ASSERT_EQ(model.levels(), 3u);
  TensorSet tensors;
  model.save(tensors, true);
  MeshModel again(*device, config, part);
  again.restore("state", *decodeSafetensors(tensors.encode({})));
  for (const uint32_t number : {1u, 2u}) {
    const std::vector<float> vertices = device->read(model.level(number).displacements().values.all());
    EXPECT_EQ(device->read(again.level(number).displacements().values.all()), vertices);
    EXPECT_EQ(*std::max_element(vertices.begin(), vertices.end()), kMaxDisplacement);
  }
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
