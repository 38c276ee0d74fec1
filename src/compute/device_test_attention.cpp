// Test cases of fusing features and of shading composited rays.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "compute/attention.h"
#include "compute/device_test.h"
#include "compute/rows.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kFeatures = AttentionShape::kFeatures, kCoarse = 16;

// Every kind of weights with each number of levels.
std::vector<AttentionShape> shapes() {
  std::vector<AttentionShape> all;
  for (const uint32_t levels : {1u, 2u, 4u}) {
    all.push_back({levels, AttentionWeights::none, true});
    for (const AttentionWeights weights : {AttentionWeights::shared, AttentionWeights::separate}) {
      for (const bool varies : {true, false}) all.push_back({levels, weights, varies});
    }
  }
  return all;
}

std::string caseName(const AttentionShape& shape) {
  const char* const kNames[] = {"sum", "shared", "separate"};
  return fmt::format("{} levels, {}{}", shape.levels, kNames[static_cast<int>(shape.weights)],
                     shape.varies ? "" : ", the same everywhere");
}

// A matrix grouped by level, as hash grids write it.
Matrix<float> byLevel(Slice<float> buffer, const AttentionShape& shape, size_t rows) {
  return Matrix<float>::grouped(buffer, kFeatures * shape.levels, kFeatures, rows);
}

struct Inputs {
  std::vector<float> coarse, fine, logits;

  Inputs(Stage& stage, const AttentionShape& shape, size_t rows)
      : coarse(stage.random.floats(kCoarse * rows, -3, 3)),
        fine(stage.random.floats(kFeatures * shape.levels * rows, -3, 3)),
        logits(stage.random.floats(shape.logits(), -3, 3)) {
    for (size_t s = 0; s < rows; s += 5) coarse[kCoarse * s] = 40;  // above the bound of the density
  }
  template <class Arguments>
  void set(Stage& stage, size_t rows, Arguments& a) const {
    a.coarse = Matrix<float>(stage.input(coarse), kCoarse);
    a.fine = byLevel(stage.input(fine), a.shape, rows);
    if (!a.shape.varies) a.logits = stage.input(logits);
  }
};

}  // namespace

template <>
OperationTests makeTests<AttentionForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is AttentionBackward";
  for (const AttentionShape& shape : shapes())
    for (const Size& size : kSizes)
      tests.cases.push_back({fmt::format("{}, samples {}", caseName(shape), toString(size)), [=](Stage& stage) {
                               AttentionForward a{shape};
                               a.samples = stage.count(size);
                               Inputs(stage, shape, size.capacity).set(stage, size.capacity, a);
                               a.features = stage.outputMatrix("features", size.capacity, kFeatures, Layout::plain);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<AttentionBackward>() {
  OperationTests tests;
  for (const AttentionShape& shape : shapes())
    for (const Size& size : kSizes)
      tests.cases.push_back({fmt::format("{}, samples {}", caseName(shape), toString(size)), [=](Stage& stage) {
                               const size_t rows = size.capacity;
                               AttentionBackward a{shape};
                               a.samples = stage.count(size);
                               Inputs(stage, shape, rows).set(stage, rows, a);
                               a.logDensityGradients = stage.randomInput(rows, -1, 1);
                               a.colourGradients = stage.randomMatrix(rows, kFeatures - 1, Layout::strided, -1, 1);
                               a.coarseGradients = stage.outputMatrix("coarseGradients", rows, kCoarse, Layout::plain);
                               a.fineGradients =
                                   byLevel(stage.output("fineGradients", kFeatures * shape.levels * rows), shape, rows);
                               if (!shape.varies) {
                                 a.logitGradients =
                                     stage.output("logitGradients", stage.random.floats(shape.logits(), -1, 1));
                               }
                               stage.device.run(a);
                             }});
  for (const AttentionShape& shape : shapes())
    tests.gradients.push_back(
        {caseName(shape), [=](Stage& stage) {
           const size_t rows = 6;
           Inputs inputs(stage, shape, rows);
           const std::vector<float> upstream = stage.random.floats(kFeatures * rows, -1, 1);
           std::vector<float> ofDensity, ofColours;
           for (size_t i = 0; i < upstream.size(); ++i)
             (i % kFeatures == 0 ? ofDensity : ofColours).push_back(upstream[i]);
           AttentionBackward a{shape};
           a.samples = stage.count({static_cast<uint32_t>(rows)});
           inputs.set(stage, rows, a);
           a.logDensityGradients = stage.input(ofDensity);
           a.colourGradients = Matrix<float>(stage.input(ofColours), kFeatures - 1);
           a.coarseGradients = Matrix<float>(stage.output("coarse", kCoarse * rows), kCoarse);
           // The fine features in row-major order, for the differences.
           const uint32_t columns = kFeatures * shape.levels;
           std::vector<float> fineRows(columns * rows);
           for (size_t s = 0; s < rows; ++s)
             for (size_t c = 0; c < columns; ++c)
               fineRows[columns * s + c] = inputs.fine[byLevel({}, shape, rows).offset(s, c)];
           a.fine = Matrix<float>(stage.input(fineRows), columns);
           a.fineGradients = Matrix<float>(stage.output("fine", fineRows.size()), columns);
           if (!shape.varies) a.logitGradients = stage.output("logits", std::vector<float>(shape.logits()));
           stage.device.run(a);
           Doubles coarse = toDoubles(inputs.coarse), fine = toDoubles(fineRows), logits = toDoubles(inputs.logits);
           const auto loss = [&] {
             double sum = 0;
             for (size_t s = 0; s < rows; ++s) {
               const View row = View(coarse).subspan(kCoarse * s, kCoarse);
               const Doubles fused = reference::fusedFeatures(shape, row, View(fine).subspan(columns * s, columns),
                                                              shape.varies ? row.subspan(kFeatures) : View(logits));
               for (size_t f = 0; f < kFeatures; ++f) sum += upstream[kFeatures * s + f] * fused[f];
             }
             return sum;
           };
           std::vector<GradientPair> pairs;
           const auto check = [&](const char* name, Slice<float> gradients, Doubles& of) {
             const auto moved = [&](View x) {
               const Doubles before = std::exchange(of, Doubles(x.begin(), x.end()));
               const double value = loss();
               of = before;
               return value;
             };
             pairs.push_back(
                 {name, stage.device.read(gradients), centralDifferences(moved, of, 1e-4, firstIndices(of.size()))});
           };
           check("coarse", a.coarseGradients.data, coarse);
           check("fine", a.fineGradients.data, fine);
           if (!shape.varies && shape.logits() > 0) check("logits", a.logitGradients, logits);
           return pairs;
         }});
  return tests;
}

namespace {

// Sets the arguments that forward and backward share.
template <class Arguments>
void setInputs(Stage& stage, const Size& size, bool whole, Arguments& a) {
  a.whole = whole;
  a.rays = stage.count(size);
  a.diffuse = stage.randomMatrix(size.capacity, 3, Layout::strided, -3, 3);
  a.specular = stage.randomMatrix(size.capacity, 3, Layout::plain, -3, 3);
  if (!whole) a.opacity = stage.randomInput(size.capacity, 0, 1);
}

std::string caseName(const Size& size, bool whole) {
  return fmt::format("rays {}{}", toString(size), whole ? ", nothing behind" : "");
}

}  // namespace

template <>
OperationTests makeTests<ShadeForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is ShadeBackward";
  for (bool whole : {false, true})
    for (const Size& size : kSizes)
      tests.cases.push_back({caseName(size, whole), [=](Stage& stage) {
                               ShadeForward a;
                               setInputs(stage, size, whole, a);
                               a.colour = stage.output("colour", size_t{3} * size.capacity);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<ShadeBackward>() {
  OperationTests tests;
  for (bool whole : {false, true}) {
    for (const Size& size : kSizes)
      tests.cases.push_back({caseName(size, whole), [=](Stage& stage) {
                               ShadeBackward a;
                               setInputs(stage, size, whole, a);
                               a.colourGradients = stage.randomInput(size_t{3} * size.capacity, -1, 1);
                               a.sumGradients = stage.outputMatrix("sumGradients", size.capacity, 3, Layout::strided);
                               if (!whole)
                                 a.opacityGradients =
                                     stage.output("opacityGradients", stage.random.floats(size.capacity, -1, 1));
                               stage.device.run(a);
                             }});
    tests.gradients.push_back(
        {whole ? "nothing behind" : "with opacity", [=](Stage& stage) {
           constexpr uint32_t kRays = 5;
           const std::vector<float> diffuse = stage.random.floats(3 * kRays, -2, 2),
                                    specular = stage.random.floats(3 * kRays, -2, 2),
                                    opacity = stage.random.floats(kRays, 0.1f, 1),
                                    upstream = stage.random.floats(3 * kRays, -1, 1);
           ShadeBackward a;
           a.whole = whole;
           a.rays = stage.count({kRays});
           a.diffuse = Matrix<float>(stage.input(diffuse), 3);
           a.specular = Matrix<float>(stage.input(specular), 3);
           a.opacity = stage.input(opacity);
           a.colourGradients = stage.input(upstream);
           a.sumGradients = Matrix<float>(stage.output("sums", 3 * kRays), 3);
           a.opacityGradients = stage.output("opacity", std::vector<float>(kRays));
           stage.device.run(a);
           const auto loss = [&](View d, View s, View o) {
             double sum = 0;
             for (size_t r = 0; r < kRays; ++r) {
               const reference::Point colour = reference::shadedColour(&d[3 * r], &s[3 * r], whole ? 1 : o[r]);
               for (size_t c = 0; c < 3; ++c) sum += upstream[3 * r + c] * colour[c];
             }
             return sum;
           };
           const Doubles d = toDoubles(diffuse), s = toDoubles(specular), o = toDoubles(opacity);
           const std::vector<uint32_t> all = firstIndices(3 * kRays);
           const std::vector<float> sums = stage.device.read(a.sumGradients.data);
           std::vector<GradientPair> pairs = {
               {"diffuse", sums, centralDifferences([&](View x) { return loss(x, s, o); }, d, 1e-4, all)},
               {"specular", sums, centralDifferences([&](View x) { return loss(d, x, o); }, s, 1e-4, all)}};
           if (!whole) {
             pairs.push_back({"opacity", stage.device.read(a.opacityGradients),
                              centralDifferences([&](View x) { return loss(d, s, x); }, o, 1e-4, firstIndices(kRays))});
           }
           return pairs;
         }});
  }
  return tests;
}

template <>
OperationTests makeTests<AddColumns>() {
  OperationTests tests;
  tests.noGradient = "it is a sum";
  for (const Layout layout : {Layout::plain, Layout::strided, Layout::grouped})
    for (const Size& size : kSizes)
      tests.cases.push_back(
          {fmt::format("layout {}, rows {}", static_cast<int>(layout), toString(size)), [=](Stage& stage) {
             AddColumns a;
             a.rows = stage.count(size);
             a.input = stage.randomMatrix(size.capacity, 6, Layout::plain, -1, 1);
             a.output = stage.randomMatrix(size.capacity, 6, layout, -1, 1);
             stage.device.run(a);
             stage.output("output", stage.device.read(a.output.data));
           }});
  return tests;
}

}  // namespace tessera::device_test
