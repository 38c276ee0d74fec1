// Test cases of the hash grid, spherical harmonics and frequency encodings.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "compute/device_test.h"
#include "compute/encodings.h"
#include "compute/hash_grid.h"

namespace tessera::device_test {
namespace {

struct NamedGrid {
  std::string name;
  HashGrid grid;
};

std::vector<NamedGrid> grids() {
  std::vector<NamedGrid> all;
  for (int features : {1, 2, 4, 8})
    all.push_back({fmt::format("4 levels of {}", features), HashGrid({4, features, 10, 4, 40})});
  all.push_back({"1 level, dense", HashGrid({1, 2, 12, 16, 16})});
  all.push_back({"16 levels to 2048", HashGrid({16, 2, 12, 16, 2048})});
  return all;
}

// Positions in [0,1]³, including coordinates 0 and 1, and one point twice.
std::vector<float> anyPositions(Random& random, size_t count) {
  std::vector<float> positions = random.floats(3 * count, 0, 1);
  for (size_t i = 0; i < positions.size(); i += 17) positions[i] = random.below(2) ? 1.0f : 0.0f;
  for (size_t i = 3; i < 6 && positions.size() > 6; ++i) positions[i] = positions[i - 3];
  return positions;
}

// Positions at which the position gradient is continuous: away from the lattice planes of every level.
std::vector<float> positionsInsideCells(Random& random, const HashGrid& grid, size_t count) {
  std::vector<float> positions;
  while (positions.size() < 3 * count) {
    const float x = random.uniform(0, 1);
    const bool inside = std::all_of(grid.levels.begin(), grid.levels.end(), [&](const HashGridLevel& level) {
      const double position = static_cast<double>(level.scale) * x + 0.5, w = position - std::floor(position);
      return w > 0.01 && w < 0.99;
    });
    if (inside) positions.push_back(x);
  }
  return positions;
}

Matrix<float> groupedByLevel(Slice<float> slice, const HashGrid& grid, size_t rows) {
  return Matrix<float>::grouped(slice, grid.columns(), grid.features, rows);
}

}  // namespace

template <>
OperationTests makeTests<HashGridForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is HashGridBackward";
  for (const NamedGrid& named : grids())
    for (const Size& size : kRowSizes)
      tests.cases.push_back({named.name + ", samples " + toString(size), [=](Stage& stage) {
                               const HashGrid& grid = named.grid;
                               const size_t rows = size.capacity + (size.capacity > 0 ? stage.random.below(4) : 0);
                               stage.device.run(HashGridForward{
                                   grid, stage.count(size), stage.input(anyPositions(stage.random, size.capacity)),
                                   stage.randomInput(grid.parameters(), -1, 1),
                                   groupedByLevel(stage.output("encoded", rows * grid.columns(), 5e-4), grid, rows)});
                             }});
  return tests;
}

template <>
OperationTests makeTests<HashGridBackward>() {
  OperationTests tests;
  for (const NamedGrid& named : grids())
    for (const Size& size : kRowSizes)
      for (int optional = 0; optional < 3; ++optional) {
        const bool withPositions = optional > 0, onlyPositions = optional == 2;
        tests.cases.push_back(
            {fmt::format("{}, samples {}{}{}", named.name, toString(size), withPositions ? ", position gradients" : "",
                         onlyPositions ? " only" : ""),
             [=](Stage& stage) {
               const HashGrid& grid = named.grid;
               const size_t rows = size.capacity;
               const std::vector<float> positions = withPositions
                                                        ? positionsInsideCells(stage.random, grid, size.capacity)
                                                        : anyPositions(stage.random, size.capacity);
               stage.device.run(HashGridBackward{
                   grid, stage.count(size), stage.input(positions),
                   withPositions ? stage.randomInput(grid.parameters(), -1, 1) : Slice<float>(),
                   groupedByLevel(stage.randomInput(rows * grid.columns(), -1, 1), grid, rows),
                   onlyPositions ? Slice<float>()
                                 : stage.output("tableGradients", stage.random.floats(grid.parameters(), -1, 1), 5e-4),
                   withPositions ? stage.output("positionGradients", 3 * rows, 1e-3) : Slice<float>()});
             }});
      }
  for (const NamedGrid& named : grids())
    tests.gradients.push_back(
        {named.name, [=](Stage& stage) {
           const HashGrid& grid = named.grid;
           const size_t samples = 11;
           const std::vector<float> positions = positionsInsideCells(stage.random, grid, samples);
           const std::vector<float> table = stage.random.floats(grid.parameters(), -1, 1);
           const std::vector<float> upstream = stage.random.floats(samples * grid.columns(), -1, 1);
           Matrix<float> grouped = groupedByLevel(stage.input(std::vector<float>(upstream.size())), grid, samples);
           std::vector<float> placed(upstream.size());
           for (size_t i = 0; i < upstream.size(); ++i)
             placed[grouped.offset(i / grid.columns(), i % grid.columns())] = upstream[i];
           stage.device.write(grouped.data, std::span<const float>(placed));
           const Slice<float> tableGradients = stage.input(std::vector<float>(grid.parameters()));
           const Slice<float> positionGradients = stage.output("positionGradients", 3 * samples);
           stage.device.run(HashGridBackward{grid, Count{samples, {}}, stage.input(positions), stage.input(table),
                                             grouped, tableGradients, positionGradients});

           const std::vector<float> all = stage.device.read(tableGradients);
           std::vector<uint32_t> touched;  // some entries with a gradient and some without
           for (uint32_t i = 0; i < all.size() && touched.size() < 40; i += 1 + stage.random.below(5))
             if (all[i] != 0 || i % 97 == 0) touched.push_back(i);
           const auto loss = [&](View x, View t) {
             return dot(toDoubles(upstream), reference::hashGridForward(grid, x, t));
           };
           const Doubles x = toDoubles(positions), t = toDoubles(table);
           return std::vector<GradientPair>{
               {"table", pick(all, touched),
                centralDifferences([&](View moved) { return loss(x, moved); }, t, 1e-3, touched), 1e-3},
               {"positions", stage.device.read(positionGradients),
                centralDifferences([&](View moved) { return loss(moved, t); }, x, 1e-7, firstIndices(3 * samples)),
                1e-3}};
         }});
  return tests;
}

template <>
OperationTests makeTests<SphericalHarmonicsForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is SphericalHarmonicsBackward";
  for (int degree = 1; degree <= 4; ++degree)
    for (const Size& size : kSizes)
      for (bool byRay : {false, true})
        tests.cases.push_back({fmt::format("degree {}, samples {}{}", degree, toString(size), byRay ? ", by ray" : ""),
                               [=](Stage& stage) {
                                 const size_t directions = byRay ? 13 : size.capacity;
                                 SphericalHarmonicsForward a;
                                 a.degree = degree;
                                 a.samples = stage.count(size);
                                 a.directions = stage.input(stage.random.directions(directions));
                                 if (byRay) a.rayOfSample = stage.input(stage.random.wordsBelow(size.capacity, 13));
                                 a.encoded = stage.outputMatrix("encoded", size.capacity, degree * degree,
                                                                byRay ? Layout::strided : Layout::plain);
                                 stage.device.run(a);
                               }});
  return tests;
}

template <>
OperationTests makeTests<SphericalHarmonicsBackward>() {
  OperationTests tests;
  for (int degree = 1; degree <= 4; ++degree)
    for (const Size& size : kSizes)
      for (bool byRay : {false, true})
        tests.cases.push_back({fmt::format("degree {}, samples {}{}", degree, toString(size), byRay ? ", by ray" : ""),
                               [=](Stage& stage) {
                                 SphericalHarmonicsBackward a;
                                 a.degree = degree;
                                 a.samples = stage.count(size);
                                 a.directions = stage.input(stage.random.directions(byRay ? 13 : size.capacity));
                                 if (byRay) a.rayOfSample = stage.input(stage.random.wordsBelow(size.capacity, 13));
                                 a.encodedGradients = stage.randomMatrix(
                                     size.capacity, degree * degree, byRay ? Layout::strided : Layout::plain, -1, 1);
                                 a.directionGradients = stage.output("directionGradients", 3 * size.capacity);
                                 stage.device.run(a);
                               }});
  for (int degree = 2; degree <= 4; ++degree)
    tests.gradients.push_back(
        {fmt::format("degree {}", degree), [=](Stage& stage) {
           const uint32_t samples = 19, columns = degree * degree;
           const std::vector<float> directions = stage.random.directions(samples);
           const std::vector<float> upstream = stage.random.floats(samples * columns, -1, 1);
           SphericalHarmonicsBackward a;
           a.degree = degree;
           a.samples.capacity = samples;
           a.directions = stage.input(directions);
           a.encodedGradients = stage.makeMatrix(upstream, columns, Layout::plain);
           a.directionGradients = stage.output("directionGradients", 3 * samples);
           stage.device.run(a);
           const auto loss = [&](View d) {
             double sum = 0;
             for (size_t s = 0; s < samples; ++s)
               sum += dot(toDoubles({upstream.begin() + s * columns, upstream.begin() + (s + 1) * columns}),
                          reference::sphericalHarmonics(degree, &d[3 * s]));
             return sum;
           };
           return std::vector<GradientPair>{
               {"directions", stage.device.read(a.directionGradients),
                centralDifferences(loss, toDoubles(directions), 1e-5, firstIndices(3 * samples))}};
         }});
  return tests;
}

namespace {

struct FrequencyShape {
  int dimensions, frequencies;
};
constexpr FrequencyShape kFrequencyShapes[] = {{3, 4}, {1, 6}, {2, 0}, {5, 1}};

}  // namespace

template <>
OperationTests makeTests<FrequencyForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is FrequencyBackward";
  for (const auto& [dimensions, frequencies] : kFrequencyShapes)
    for (const Size& size : kSizes)
      tests.cases.push_back(
          {fmt::format("{} dimensions, {} frequencies, samples {}", dimensions, frequencies, toString(size)),
           [=, dimensions = dimensions, frequencies = frequencies](Stage& stage) {
             FrequencyForward a;
             a.dimensions = dimensions;
             a.frequencies = frequencies;
             a.samples = stage.count(size);
             a.inputs = stage.randomInput(size.capacity * dimensions, -2, 2);
             a.encoded = stage.outputMatrix("encoded", size.capacity, dimensions * (1 + 2 * frequencies),
                                            dimensions == 3 ? Layout::plain : Layout::strided, 2e-5);
             stage.device.run(a);
           }});
  return tests;
}

template <>
OperationTests makeTests<FrequencyBackward>() {
  OperationTests tests;
  for (const auto& [dimensions, frequencies] : kFrequencyShapes) {
    const uint32_t columns = dimensions * (1 + 2 * frequencies);
    for (const Size& size : kSizes)
      tests.cases.push_back(
          {fmt::format("{} dimensions, {} frequencies, samples {}", dimensions, frequencies, toString(size)),
           [=, dimensions = dimensions, frequencies = frequencies](Stage& stage) {
             FrequencyBackward a;
             a.dimensions = dimensions;
             a.frequencies = frequencies;
             a.samples = stage.count(size);
             a.inputs = stage.randomInput(size.capacity * dimensions, -2, 2);
             a.encodedGradients =
                 stage.randomMatrix(size.capacity, columns, dimensions == 3 ? Layout::plain : Layout::strided, -1, 1);
             a.inputGradients = stage.output("inputGradients", size.capacity * dimensions, 2e-5);
             stage.device.run(a);
           }});
    tests.gradients.push_back(
        {fmt::format("{} dimensions, {} frequencies", dimensions, frequencies),
         [=, dimensions = dimensions, frequencies = frequencies](Stage& stage) {
           const uint32_t samples = 9;
           const std::vector<float> inputs = stage.random.floats(samples * dimensions, -2, 2);
           const std::vector<float> upstream = stage.random.floats(samples * columns, -1, 1);
           FrequencyBackward a;
           a.dimensions = dimensions;
           a.frequencies = frequencies;
           a.samples.capacity = samples;
           a.inputs = stage.input(inputs);
           a.encodedGradients = stage.makeMatrix(upstream, columns, Layout::plain);
           a.inputGradients = stage.output("inputGradients", inputs.size());
           stage.device.run(a);
           const auto loss = [&](View x) {
             double sum = 0;
             for (size_t s = 0; s < samples; ++s)
               sum += dot(toDoubles({upstream.begin() + s * columns, upstream.begin() + (s + 1) * columns}),
                          reference::frequencyEncoding(dimensions, frequencies, &x[s * dimensions]));
             return sum;
           };
           return std::vector<GradientPair>{
               {"inputs", stage.device.read(a.inputGradients),
                centralDifferences(loss, toDoubles(inputs), 1e-5, firstIndices(inputs.size()))}};
         }});
  }
  return tests;
}

}  // namespace tessera::device_test
