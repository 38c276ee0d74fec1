// Test cases of ray generation, marching, compaction, gathering and occupancy.
#include <fmt/format.h>

#include <cmath>

#include "compute/device_test.h"
#include "compute/occupancy.h"
#include "compute/rays.h"
#include "compute/rows.h"
#include "scene/camera.h"

namespace tessera::device_test {
namespace {

// A camera with an image of about 640 × 480 pixels, realistic distortion and a random pose.
RayCamera randomCamera(Random& random, LensModel lens) {
  RayCamera camera;
  camera.lens = static_cast<int32_t>(lens);
  const float focal = random.uniform(400, 700);
  const bool oneFocal = lens == LensModel::simplePinhole || lens == LensModel::simpleRadial ||
                        lens == LensModel::radial || lens == LensModel::simpleRadialFisheye ||
                        lens == LensModel::radialFisheye || lens == LensModel::simpleDivision;
  int used = 0;
  camera.parameters[used++] = focal;
  if (!oneFocal) camera.parameters[used++] = focal * 1.01f;
  camera.parameters[used++] = 321;
  camera.parameters[used++] = 239;
  for (; used < lensParameterCount(lens); ++used) camera.parameters[used] = random.uniform(-0.01f, 0.02f);
  if (lens == LensModel::fov) camera.parameters[4] = 0.8f;
  if (lens == LensModel::eucm) {
    camera.parameters[4] = 0.6f;
    camera.parameters[5] = 1.1f;
  }
  const std::vector<float> axes = random.directions(2);  // orthogonalised by Gram-Schmidt into a rotation
  const Vec3d x(axes[0], axes[1], axes[2]), z = x.cross(Vec3d(axes[3], axes[4], axes[5])).normalized(), y = z.cross(x);
  for (int row = 0; row < 3; ++row) {
    camera.rotation[3 * row] = static_cast<float>(x[row]);
    camera.rotation[3 * row + 1] = static_cast<float>(y[row]);
    camera.rotation[3 * row + 2] = static_cast<float>(z[row]);
    camera.centre[row] = random.uniform(-1, 1);
  }
  return camera;
}

struct NamedSpace {
  std::string name;
  MarchSpace space;
};

std::vector<NamedSpace> spaces() {
  std::vector<NamedSpace> all(6);
  all[0] = {"contracted", {.contracted = true, .gridResolution = 16, .far = 50, .minStep = 0.02f, .cone = 1.0f / 64}};
  all[1] = {"contracted, uniform steps",
            {.contracted = true, .gridResolution = 12, .far = 5, .minStep = 0.03f, .cone = 0}};
  all[2] = {"contracted, steps bounded",
            {.contracted = true,
             .gridResolution = 16,
             .near = 0,
             .far = 30,
             .minStep = 0.02f,
             .maxStep = 0.1f,
             .cone = 0.02f}};
  all[3] = {"contracted, fine grid",
            {.contracted = true, .gridResolution = 64, .far = 1000, .minStep = 0.00338f, .cone = 1.0f / 256}};
  all[4] = {"bounded, uniform steps", {.contracted = false, .gridResolution = 16, .minStep = 0.02f, .cone = 0}};
  all[5] = {"bounded, fine grid",
            {.contracted = false, .gridResolution = 32, .near = 0.2f, .minStep = 0.01f, .cone = 0.01f}};
  return all;
}

// The bits of an occupancy grid, each set with probability `share`.
std::vector<uint32_t> randomBits(Random& random, const MarchSpace& space, float share) {
  const uint32_t cells = space.gridResolution * space.gridResolution * space.gridResolution;
  std::vector<uint32_t> bits(cells / 32);
  for (uint32_t cell = 0; cell < cells; ++cell)
    if (random.uniform(0, 1) < share) bits[cell / 32] |= 1u << cell % 32;
  return bits;
}

// Rays with origins inside and outside the cube, and with random, axis-parallel and zero directions.
void makeRays(Random& random, size_t rays, std::vector<float>* origins, std::vector<float>* directions) {
  *origins = random.floats(3 * rays, -0.9f, 0.9f);
  *directions = random.directions(rays);
  for (size_t r = 0; r < rays; ++r) {
    float* const o = origins->data() + 3 * r;
    float* const d = directions->data() + 3 * r;
    if (r % 3 == 1)
      for (int a = 0; a < 3; ++a) o[a] *= 3;
    if (r % 7 == 3)
      for (int a = 0; a < 3; ++a) d[a] = a == static_cast<int>(r / 7 % 3) ? (r % 2 ? 1.0f : -1.0f) : 0.0f;
    if (r % 11 == 5) d[0] = d[1] = d[2] = 0;
  }
}

}  // namespace

template <>
OperationTests makeTests<GenerateRays>() {
  OperationTests tests;
  tests.noGradient = "cameras and pixels are fixed";
  for (const Size& size : kSizes)
    tests.cases.push_back({"every lens, rays " + toString(size), [=](Stage& stage) {
                             constexpr uint32_t kLenses = std::size(kLensModels);
                             std::vector<float> words;  // cameras, as 32-bit words
                             for (const LensModel lens : kLensModels) {
                               const RayCamera camera = randomCamera(stage.random, lens);
                               const float* const from = reinterpret_cast<const float*>(&camera);
                               words.insert(words.end(), from, from + sizeof(camera) / sizeof(float));
                             }
                             const Slice<float> memory = stage.input(words);
                             std::vector<float> pixels = stage.random.floats(2 * size.capacity, 0, 480);
                             for (size_t i = 0; i < pixels.size(); i += 26)
                               pixels[i] = 1e7f;  // far outside the image, where the lens may have no inverse
                             GenerateRays a;
                             a.rays = stage.count(size);
                             a.cameras = Slice<const RayCamera>(memory.memory, 0, kLenses);
                             a.cameraOfRay = stage.input(stage.random.wordsBelow(size.capacity, kLenses));
                             a.pixels = stage.input(pixels);
                             a.origins = stage.output("origins", 3 * size.capacity, 0);
                             a.directions = stage.output("directions", 3 * size.capacity, 3e-5);
                             stage.device.run(a);
                           }});
  return tests;
}

template <>
OperationTests makeTests<MarchRays>() {
  OperationTests tests;
  tests.decides = true;
  tests.noGradient = "sample positions carry no gradient";
  for (const NamedSpace& named : spaces())
    for (const Size& size : {Size{0}, Size{1}, Size{37}, Size{40, 23}, Size{5, 0}, Size{150, 1000}})
      for (float share : {0.0f, 0.02f, 0.4f, 1.0f})
        for (int optional = 0; optional < 2; ++optional) {
          if (share == 1 && size.used() > 40) continue;
          // In the second case the capacity is too small for all samples.
          const uint32_t sampleCapacity = optional == 0 ? 60000 : 300;
          tests.cases.push_back({fmt::format("{}, rays {}, {} occupied, {}", named.name, toString(size), share,
                                             optional == 0 ? "plain" : "jitter, far of ray, few samples"),
                                 [=](Stage& stage) {
                                   std::vector<float> origins, directions;
                                   makeRays(stage.random, size.capacity, &origins, &directions);
                                   const Slice<float> jitter =
                                       optional ? stage.randomInput(size.capacity, 0, 1) : Slice<float>();
                                   const Slice<float> farOfRay =
                                       optional ? stage.randomInput(size.capacity, 0, 8) : Slice<float>();
                                   MarchRays a{named.space};
                                   a.rays = stage.count(size);
                                   a.sampleCapacity = sampleCapacity;
                                   a.origins = stage.input(origins);
                                   a.directions = stage.input(directions);
                                   a.jitter = jitter;
                                   a.farOfRay = farOfRay;
                                   a.occupancy = stage.input(randomBits(stage.random, named.space, share));
                                   a.firstSample = stage.outputWords("firstSample", size.capacity + 1);
                                   a.sampleCount = stage.outputWords("sampleCount", 1);
                                   if (optional) {
                                     a.finishedRays = stage.outputWords("finishedRays", 1);
                                     a.rayOfSample = stage.outputWords("rayOfSample", sampleCapacity);
                                   }
                                   a.positions = stage.output("positions", 3 * sampleCapacity, 1e-6);
                                   a.distances = stage.output("distances", sampleCapacity, 1e-6);
                                   a.steps = stage.output("steps", sampleCapacity, 1e-6);
                                   stage.device.run(a);
                                 }});
        }
  for (const NamedSpace& named : spaces())
    for (float share : {0.1f, 1.0f})
      tests.cases.push_back({fmt::format("{}, {} occupied, in rounds", named.name, share), [=](Stage& stage) {
                               const uint32_t rays = 37, sampleCapacity = 300;
                               std::vector<float> origins, directions;
                               makeRays(stage.random, rays, &origins, &directions);
                               const std::vector<float> opaque = stage.random.floats(rays, 0, 1);
                               MarchRays a{named.space};
                               a.rays.capacity = rays;
                               a.sampleCapacity = sampleCapacity;
                               a.maxOpticalDepth = 0.8f;
                               a.origins = stage.input(origins);
                               a.directions = stage.input(directions);
                               a.jitter = stage.randomInput(rays, 0, 1);
                               a.occupancy = stage.input(randomBits(stage.random, named.space, share));
                               a.opticalDepth = stage.input(opaque);
                               a.nextStep = stage.outputWords("nextStep", std::vector<uint32_t>(rays));
                               for (const uint32_t maximum : {5u, 0u, 1u, 15u, ~0u}) {  // the fourth round does not fit
                                 a.maximum = maximum;
                                 a.firstSample = stage.outputWords("firstSample", rays + 1);
                                 a.sampleCount = stage.outputWords("sampleCount", 1);
                                 a.positions = stage.output("positions", 3 * sampleCapacity, 1e-6);
                                 a.distances = stage.output("distances", sampleCapacity, 1e-6);
                                 a.steps = stage.output("steps", sampleCapacity, 1e-6);
                                 stage.device.run(a);
                               }
                             }});
  return tests;
}

template <>
OperationTests makeTests<OpticalDepth>() {
  OperationTests tests;
  tests.noGradient = "it only decides which samples are seen";
  for (const Size& size : kSizes)
    for (Layout layout : {Layout::plain, Layout::strided})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), layout == Layout::strided ? ", strided" : ""), [=](Stage& stage) {
             const std::vector<uint32_t> first = stage.random.firstSamples(size.capacity, 40);
             OpticalDepth a;
             a.rays = stage.count(size);
             a.firstSample = stage.input(first);
             a.logDensity = stage.randomMatrix(first.back(), 1, layout, -3, 6);
             a.steps = stage.randomInput(first.back(), 0.001f, 0.1f);
             a.opticalDepth = stage.output("opticalDepth", stage.random.floats(size.capacity, 0, 3));
             stage.device.run(a);
           }});
  return tests;
}

template <>
OperationTests makeTests<CompactSamples>() {
  OperationTests tests;
  tests.noGradient = "it chooses samples; none is changed";
  for (const Size& size : kSizes)
    for (const uint32_t rounds : {1u, 3u})
      tests.cases.push_back({fmt::format("rays {}, {} rounds", toString(size), rounds), [=](Stage& stage) {
                               std::vector<uint32_t> first;
                               uint32_t capacity = 9;  // per round
                               for (uint32_t round = 0; round < rounds; ++round) {
                                 const auto ofRound = stage.random.firstSamples(size.capacity, 40 / rounds);
                                 first.insert(first.end(), ofRound.begin(), ofRound.end());
                                 capacity = std::max(capacity, ofRound.back() + 9);
                               }
                               std::vector<uint32_t> nextStep = stage.random.wordsBelow(size.capacity, 500);
                               for (uint32_t& step : nextStep)
                                 if (step > 50) step = MarchRays::kThrough;
                               CompactSamples a;
                               a.rays = stage.count(size);
                               a.rounds = rounds;
                               a.sampleCapacity = capacity;
                               a.keptCapacity = capacity * rounds;
                               a.maxOpticalDepth = 9.2f;
                               a.firstSample = stage.input(first);
                               if (rounds > 1) {  // some rays are not finished, and not all samples fit
                                 a.nextStep = stage.input(nextStep);
                                 a.finishedRays = stage.outputWords("finishedRays", 1);
                                 a.maxOpticalDepth = 1.2f;
                                 a.keptCapacity = capacity / 2;
                               }
                               a.logDensity = stage.randomMatrix(size_t{capacity} * rounds, 1,
                                                                 rounds > 1 ? Layout::strided : Layout::plain, -3, 6);
                               a.steps = stage.randomInput(size_t{capacity} * rounds, 0.001f, 0.1f);
                               a.keptFirstSample = stage.outputWords("keptFirstSample", size.capacity + 1);
                               a.keptCount = stage.outputWords("keptCount", 1);
                               a.source = stage.outputWords("source", a.keptCapacity);
                               a.rayOfSample = stage.outputWords("rayOfSample", a.keptCapacity);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<GatherRows>() {
  OperationTests tests;
  tests.noGradient = "it moves what will be computed again";
  struct Shape {
    uint32_t columns;
    Layout input, output;
  };
  for (const Shape& shape : {Shape{1, Layout::plain, Layout::plain}, Shape{3, Layout::plain, Layout::plain},
                             Shape{16, Layout::strided, Layout::strided}, Shape{16, Layout::plain, Layout::strided},
                             Shape{8, Layout::grouped, Layout::grouped}})
    for (const Size& size : kSizes)
      tests.cases.push_back({fmt::format("{} columns{}, rows {}", shape.columns,
                                         shape.input != shape.output ? " to other strides" : "", toString(size)),
                             [=](Stage& stage) {
                               const uint32_t sources = 200;
                               // Arbitrary bits, because integers are moved too and can look like NaN or denormals.
                               Matrix<float> input = stage.randomMatrix(sources, shape.columns, shape.input, -1, 1);
                               std::vector<uint32_t> bits(input.data.count);
                               for (uint32_t& word : bits) word = stage.random.bits() >> stage.random.below(32);
                               stage.device.writeBytes(*input.data.memory, input.data.first * sizeof(float),
                                                       std::as_bytes(std::span(bits)));
                               GatherRows a;
                               a.rows = stage.count(size);
                               a.source = stage.input(stage.random.wordsBelow(size.capacity, sources));
                               a.input = input;
                               a.output = stage.outputMatrix("output", size.capacity, shape.columns, shape.output, 0);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<OccupancyPoints>() {
  OperationTests tests;
  tests.noGradient = "it only chooses where to look";
  for (const NamedSpace& named : spaces())
    for (float share : {0.0f, 0.1f, 1.0f}) {
      const uint32_t all = named.space.gridResolution * named.space.gridResolution * named.space.gridResolution;
      for (const auto& [uniform, occupied, first] :
           {std::tuple{all, 0u, 0u}, std::tuple{1003u, 517u, 0u}, std::tuple{1003u, 517u, 777u},
            std::tuple{0u, 33u, 5u}, std::tuple{17u, 0u, 0u}, std::tuple{0u, 0u, 0u}})
        tests.cases.push_back(
            {fmt::format("{}, {} occupied, {} + {} points from {}", named.name, share, uniform, occupied, first),
             [=, uniform = uniform, occupied = occupied, first = first](Stage& stage) {
               const uint32_t points = uniform + occupied - first;
               const uint64_t seed = stage.random.bits();
               Slice<const uint32_t> candidates;  // all cells, or every third if there are many points
               std::vector<uint32_t> thirds;
               for (uint32_t cell = 1; cell < all; cell += 3) thirds.push_back(cell);
               if (uniform == 1003) candidates = stage.input(thirds);
               stage.device.run(OccupancyPoints{named.space, uniform, occupied, seed, candidates,
                                                stage.input(randomBits(stage.random, named.space, share)),
                                                stage.outputWords("cells", points),
                                                stage.output("positions", 3 * points, 1e-6), first});
             }});
    }
  return tests;
}

template <>
OperationTests makeTests<OccupancyUpdate>() {
  OperationTests tests;
  tests.noGradient = "it is no part of the loss";
  for (const NamedSpace& named : spaces())
    for (uint32_t points : {0u, 1u, 1003u})
      for (Layout layout : {Layout::plain, Layout::strided})
        tests.cases.push_back({fmt::format("{}, {} points", named.name, points), [=](Stage& stage) {
                                 const uint32_t r = named.space.gridResolution, all = r * r * r;
                                 std::vector<float> grid = stage.random.floats(all, 0, 0.02f);
                                 for (float& value : grid) {
                                   const uint32_t kind = stage.random.below(10);
                                   if (kind < 2) value = -1;
                                   if (kind == 3) value = 0;
                                 }
                                 std::vector<uint32_t> cells = stage.random.wordsBelow(points, all);
                                 for (size_t i = 0; i + 1 < cells.size(); i += 5) cells[i + 1] = cells[i];
                                 std::vector<float> logDensity = stage.random.floats(points, -4, 4);
                                 for (size_t i = 0; i < logDensity.size(); i += 101)
                                   logDensity[i] = 200;  // its exponential is infinite in float
                                 stage.device.run(OccupancyUpdate{
                                     named.space, points, 0.95f, points == 1 ? 1.0f : 0.01f, stage.input(cells),
                                     stage.makeMatrix(logDensity, 1, layout), stage.output("grid", grid, 1e-6),
                                     stage.outputWords("occupancy", all / 32)});
                               }});
  return tests;
}

template <>
OperationTests makeTests<OccupancySamples>() {
  OperationTests tests;
  tests.noGradient = "it is no part of the loss";
  for (const Size& size : kSizes)
    for (Layout layout : {Layout::plain, Layout::strided})
      tests.cases.push_back(
          {fmt::format("rays {}{}", toString(size), layout == Layout::strided ? ", strided" : ""), [=](Stage& stage) {
             const uint32_t resolution = 12, cells = resolution * resolution * resolution;
             OccupancySamples a;
             a.resolution = resolution;
             a.offset = -1;
             std::vector<uint32_t> first{0};
             std::vector<float> x;
             for (size_t ray = 0; ray < size.capacity; ++ray) {
               double transmittance = 1;
               const uint32_t count = stage.random.below(30);
               for (uint32_t i = 0; i < count;) {
                 const float logit = stage.random.uniform(-4, ray % 2 ? 4.0f : 0.0f);
                 const double after = transmittance / (1 + std::exp(double{logit} + a.offset));
                 // Rounding must not decide whether the ray reaches the next sample.
                 if (std::abs(after / a.minTransmittance - 1) < 0.01) continue;
                 x.push_back(logit);
                 transmittance = after;
                 ++i;
               }
               first.push_back(static_cast<uint32_t>(x.size()));
             }
             std::vector<float> positions = stage.random.floats(3 * x.size(), 0, 1);
             for (size_t i = 0; i < positions.size(); i += 17) positions[i] = 1;
             std::vector<float> grid = stage.random.floats(cells, 0, 0.2f);
             for (float& value : grid)
               if (stage.random.below(5) == 0) value = -1;
             a.rays = stage.count(size);
             a.firstSample = stage.input(first);
             a.x = stage.makeMatrix(x, 1, layout);
             a.positions = stage.input(positions);
             a.grid = stage.output("grid", grid, 1e-6);
             stage.device.run(a);
           }});
  return tests;
}

}  // namespace tessera::device_test
