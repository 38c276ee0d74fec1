// Test cases of patches of texels.
#include <fmt/format.h>

#include <set>

#include "compute/device_test.h"
#include "compute/patches.h"

namespace tessera::device_test {
namespace {

constexpr uint32_t kTestPatches = 7, kTestFaces = 20;
constexpr uint32_t kTexelFeatures = StoreTexelsForward::kFeatures, kTexelNumbers = StoreTexelsForward::kStored;
constexpr Layout kLayouts[] = {Layout::plain, Layout::strided, Layout::grouped};
constexpr const char* kLayoutNames[] = {"plain", "strided", "grouped"};

// Whether a place is so close to a texel that rounding may decide between which texels it lies. At the border of a
// patch it decides nothing.
bool isCloseToTexel(const std::array<reference::PatchTexel, 4>& texels, uint32_t patchEdge) {
  const uint32_t inPatch = texels[0].number % (patchEdge * patchEdge);
  const uint32_t first[] = {inPatch % patchEdge, inPatch / patchEdge};
  const double between[] = {texels[1].weight + texels[3].weight, texels[2].weight + texels[3].weight};
  for (const int i : {0, 1}) {
    if (between[i] < 1e-4 && first[i] > 0) return true;
    if (between[i] > 1 - 1e-4 && first[i] < patchEdge - 2) return true;
  }
  return false;
}

// Hits within faces, on their edges and corners, and slightly outside, as rounding may place them.
struct PatchHits {
  std::vector<uint32_t> patchOfFace, faces;
  std::vector<float> barycentrics, factors;

  PatchHits(Random& random, uint32_t samples, uint32_t patchEdge, bool isProjective) {
    for (uint32_t face = 0; face < kTestFaces; ++face) {
      const uint32_t code = (random.below(2) ? kSecondTriangle : 0) + random.below(kPatchPermutations);
      patchOfFace.push_back(face % 5 == 3 ? kNoPatch : 16 * random.below(kTestPatches) + code);
    }
    if (isProjective) factors = random.floats(size_t{4} * kTestPatches, 0.3f, 3);
    faces = random.wordsBelow(samples, kTestFaces);
    for (uint32_t s = 0; s < samples; ++s) addHit(random, patchOfFace[faces[s]], patchEdge);
  }

 private:
  void addHit(Random& random, uint32_t place, uint32_t patchEdge) {
    for (;;) {
      const uint32_t kind = random.below(8), corner = random.below(3);
      float shares[3] = {random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)};
      if (kind == 0)
        for (uint32_t k = 0; k < 3; ++k) shares[k] = k == corner ? 1.0f : 0.0f;
      if (kind == 1) shares[corner] = 0;
      if (kind == 2) shares[corner] = -1e-3f;
      const float sum = shares[0] + shares[1] + shares[2], second = shares[1] / sum, third = shares[2] / sum;
      if (place != kNoPatch) {
        const Doubles all = toDoubles(factors);
        const View ofPatch = all.empty() ? View() : View(all).subspan(size_t{4} * (place / 16), 4);
        const reference::Point point = {1 - static_cast<double>(second) - third, second, third};
        if (isCloseToTexel(reference::patchTexels(patchEdge, place, point, ofPatch), patchEdge)) continue;
      }
      barycentrics.push_back(second);
      barycentrics.push_back(third);
      return;
    }
  }
};

// Ranges of features, of which the last two are empty and reversed.
std::vector<float> texelRanges() {
  std::vector<float> ranges;
  for (uint32_t f = 0; f < kTexelFeatures; ++f) {
    ranges.push_back(-1 - 0.3f * static_cast<float>(f));
    ranges.push_back(2 + 0.1f * static_cast<float>(f));
  }
  ranges[2 * kTexelFeatures - 3] = ranges[2 * kTexelFeatures - 4];
  ranges[2 * kTexelFeatures - 1] = -5;
  return ranges;
}

StoreTexelsForward storeOptions() {
  StoreTexelsForward a;
  a.offset = -0.5f;
  a.opaqueFrom = 0.8f;
  a.transparentBelow = 0.3f;
  return a;
}

// Features within their ranges, at the ends, and beyond. None is so close to where a byte changes that rounding may
// decide which byte it gets.
std::vector<float> texelFeatures(Random& random, uint32_t rows) {
  const std::vector<float> bounds = texelRanges();
  const Doubles ranges = toDoubles(bounds);
  std::vector<float> features;
  while (features.size() < size_t{kTexelFeatures} * rows) {
    std::vector<float> row = random.floats(kTexelFeatures, -4, 4);
    row[0] = random.uniform(-8, 4);
    const uint32_t atEnd = random.below(3 * kTexelFeatures);
    if (atEnd < kTexelFeatures) row[atEnd] = bounds[2 * atEnd + random.below(2)];
    Doubles lower = toDoubles(row), upper = lower;
    for (double& x : lower) x -= 1e-5;
    for (double& x : upper) x += 1e-5;
    if (reference::storedTexel(storeOptions(), ranges, lower) == reference::storedTexel(storeOptions(), ranges, upper))
      features.insert(features.end(), row.begin(), row.end());
  }
  return features;
}

struct Mixture {
  uint32_t perSample, columns;
  Layout layout;
  Size inputRows;
};
constexpr Mixture kMixtures[] = {
    {4, 9, Layout::plain, {40}},    {4, 9, Layout::strided, {64, 50}}, {4, 16, Layout::grouped, {130, 1000}},
    {1, 3, Layout::plain, {40, 0}}, {5, 1, Layout::plain, {0}},        {2, 16, Layout::plain, {1}}};

std::string mixtureName(const Mixture& mixture) {
  return fmt::format("{} of {} rows, {} columns, {}", mixture.perSample, toString(mixture.inputRows), mixture.columns,
                     kLayoutNames[static_cast<int>(mixture.layout)]);
}

// Rows of which some do not exist, and weights of which some are zero.
template <class Arguments>
void setMixture(Stage& stage, const Mixture& mixture, const Size& size, Arguments& a) {
  const size_t count = size_t{mixture.perSample} * size.capacity;
  std::vector<uint32_t> rows = stage.random.wordsBelow(count, mixture.inputRows.capacity + 5);
  std::vector<float> weights = stage.random.floats(count, -1, 1);
  for (size_t i = 0; i < count; ++i) {
    if (i % 11 == 3) rows[i] = kNoRow;
    if (i % 7 == 2) weights[i] = 0;
  }
  a.samples = stage.count(size);
  a.perSample = mixture.perSample;
  a.inputRows = stage.count(mixture.inputRows);
  a.rows = stage.input(rows);
  a.weights = stage.input(weights);
}

}  // namespace

template <>
OperationTests makeTests<PatchTexels>() {
  OperationTests tests;
  tests.noGradient = "it chooses texels, and passes no gradients to the positions of hits";
  for (const uint32_t patchEdge : {2u, 3u, 9u, 64u})
    for (const bool isProjective : {false, true})
      for (const Size& size : kSizes)
        tests.cases.push_back(
            {fmt::format("{}² texels{}, hits {}", patchEdge, isProjective ? ", projective" : "", toString(size)),
             [=](Stage& stage) {
               const PatchHits hits(stage.random, size.capacity, patchEdge, isProjective);
               PatchTexels a;
               a.samples = stage.count(size);
               a.patchEdge = patchEdge;
               a.patchOfFace = stage.input(hits.patchOfFace);
               a.faces = stage.input(hits.faces);
               a.barycentrics = stage.input(hits.barycentrics);
               a.cornerFactors = stage.input(hits.factors);
               a.texels = stage.outputWords("texels", size_t{4} * size.capacity);
               a.weights = stage.output("weights", size_t{4} * size.capacity, 1e-4);
               stage.device.run(a);
             }});
  return tests;
}

template <>
OperationTests makeTests<DistinctRows>() {
  OperationTests tests;
  tests.noGradient = "it chooses rows";
  for (const uint32_t idCount : {0u, 1u, 33u, 1000u, 300000u})
    for (const uint32_t perSample : {1u, 4u})
      for (const Size& size : kSizes)
        for (const bool tight : {false, true})
          tests.cases.push_back({fmt::format("{} ids, {} per sample, samples {}{}", idCount, perSample, toString(size),
                                             tight ? ", no room" : ""),
                                 [=](Stage& stage) {
                                   std::vector<uint32_t> ids =
                                       stage.random.wordsBelow(size_t{perSample} * size.capacity, idCount + 1);
                                   for (size_t i = 5; i < ids.size(); i += 13) ids[i] = i % 2 ? kNoRow : ids[i - 5];
                                   std::set<uint32_t> distinct;
                                   for (size_t i = 0; i < size_t{perSample} * size.used(); ++i)
                                     if (ids[i] < idCount) distinct.insert(ids[i]);
                                   DistinctRows a;
                                   a.samples = stage.count(size);
                                   a.perSample = perSample;
                                   a.ids = stage.input(ids);
                                   a.idCount = idCount;
                                   a.rowCapacity =
                                       static_cast<uint32_t>(tight ? distinct.size() / 2 : distinct.size() + 5);
                                   a.marks = stage.outputWords("marks", a.words());
                                   a.ranks = stage.outputWords("ranks", a.words());
                                   a.rowCount = stage.outputWords("rowCount", 1);
                                   a.rowIds = stage.outputWords("rowIds", a.rowCapacity);
                                   a.rows = stage.outputWords("rows", ids.size());
                                   stage.device.run(a);
                                 }});
  return tests;
}

template <>
OperationTests makeTests<StoreTexelsForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is StoreTexelsBackward";
  for (const Layout layout : kLayouts)
    for (const Size& size : kSizes)
      tests.cases.push_back(
          {fmt::format("{}, rows {}", kLayoutNames[static_cast<int>(layout)], toString(size)), [=](Stage& stage) {
             StoreTexelsForward a = storeOptions();
             a.rows = stage.count(size);
             a.features = stage.makeMatrix(texelFeatures(stage.random, size.capacity), kTexelFeatures, layout);
             a.ranges = stage.input(texelRanges());
             a.stored = stage.outputMatrix("stored", size.capacity, kTexelNumbers, layout);
             stage.device.run(a);
           }});
  return tests;
}

template <>
OperationTests makeTests<StoreTexelsBackward>() {
  OperationTests tests;
  for (const Layout layout : kLayouts)
    for (const Size& size : kSizes)
      tests.cases.push_back(
          {fmt::format("{}, rows {}", kLayoutNames[static_cast<int>(layout)], toString(size)), [=](Stage& stage) {
             StoreTexelsBackward a;
             a.offset = storeOptions().offset;
             a.rows = stage.count(size);
             a.features = stage.makeMatrix(texelFeatures(stage.random, size.capacity), kTexelFeatures, layout);
             a.ranges = stage.input(texelRanges());
             a.storedGradients = stage.randomMatrix(size.capacity, kTexelNumbers, layout, -1, 1);
             a.featureGradients = stage.outputMatrix("featureGradients", size.capacity, kTexelFeatures, layout);
             stage.device.run(a);
           }});
  tests.gradients.push_back(
      {"without rounding", [=](Stage& stage) {  // rounding passes gradients straight through
         const uint32_t rows = 30;
         std::vector<float> features = stage.random.floats(size_t{kTexelFeatures} * rows, -4, 4);
         const std::vector<float> upstream = stage.random.floats(size_t{kTexelNumbers} * rows, -1, 1);
         const Doubles ranges = toDoubles(texelRanges()), slopes = toDoubles(upstream);
         StoreTexelsBackward a;
         a.offset = storeOptions().offset;
         a.rows.capacity = rows;
         a.features = stage.makeMatrix(features, kTexelFeatures, Layout::plain);
         a.ranges = stage.input(texelRanges());
         a.storedGradients = stage.makeMatrix(upstream, kTexelNumbers, Layout::plain);
         a.featureGradients = stage.outputMatrix("featureGradients", rows, kTexelFeatures, Layout::plain);
         stage.device.run(a);
         const auto loss = [&](View moved) {
           double sum = 0;
           for (size_t row = 0; row < rows; ++row) {
             const Doubles stored = reference::storedTexel(storeOptions(), ranges,
                                                           moved.subspan(row * kTexelFeatures, kTexelFeatures), false);
             sum += dot(stored, View(slopes).subspan(row * kTexelNumbers, kTexelNumbers));
           }
           return sum;
         };
         return std::vector<GradientPair>{
             {"features", stage.device.read(a.featureGradients.data),
              centralDifferences(loss, toDoubles(features), 1e-5, firstIndices(features.size()))}};
       }});
  return tests;
}

template <>
OperationTests makeTests<MixRowsForward>() {
  OperationTests tests;
  tests.noGradient = "its gradient is MixRowsBackward";
  for (const Mixture& mixture : kMixtures)
    for (const Size& size : kSizes)
      tests.cases.push_back({fmt::format("{}, samples {}", mixtureName(mixture), toString(size)), [=](Stage& stage) {
                               MixRowsForward a;
                               setMixture(stage, mixture, size, a);
                               a.input = stage.randomMatrix(mixture.inputRows.capacity, mixture.columns, mixture.layout,
                                                            -1, 1);
                               a.output = stage.outputMatrix("output", size.capacity, mixture.columns, mixture.layout);
                               stage.device.run(a);
                             }});
  return tests;
}

template <>
OperationTests makeTests<MixRowsBackward>() {
  OperationTests tests;
  for (const Mixture& mixture : kMixtures)
    for (const Size& size : kSizes)
      tests.cases.push_back(
          {fmt::format("{}, samples {}", mixtureName(mixture), toString(size)), [=](Stage& stage) {
             MixRowsBackward a;
             setMixture(stage, mixture, size, a);
             a.outputGradients = stage.randomMatrix(size.capacity, mixture.columns, mixture.layout, -1, 1);
             a.inputGradients =
                 stage.outputMatrix("inputGradients", mixture.inputRows.capacity, mixture.columns, mixture.layout);
             if (mixture.inputRows.capacity > 0) {  // added to
               const std::vector<float> initial = stage.random.floats(a.inputGradients.data.count, -1, 1);
               stage.device.write(a.inputGradients.data, std::span<const float>(initial));
             }
             stage.device.run(a);
           }});
  tests.gradients.push_back(
      {"shared rows", [=](Stage& stage) {
         const Mixture mixture = {4, 9, Layout::plain, {20}};
         const Size size{31};
         MixRowsBackward a;
         setMixture(stage, mixture, size, a);
         const size_t rows = mixture.inputRows.capacity, columns = mixture.columns;
         const std::vector<float> input = stage.random.floats(rows * columns, -1, 1);
         const std::vector<float> upstream = stage.random.floats(size.capacity * columns, -1, 1);
         a.outputGradients = stage.makeMatrix(upstream, mixture.columns, Layout::plain);
         a.inputGradients = stage.makeMatrix(std::vector<float>(input.size()), mixture.columns, Layout::plain);
         stage.device.run(a);
         const std::vector<uint32_t> rowOfTerm = stage.device.read(a.rows);
         const std::vector<float> weights = stage.device.read(a.weights);
         const auto loss = [&](View moved) {
           double sum = 0;
           for (size_t i = 0; i < weights.size(); ++i)
             for (size_t c = 0; c < columns && rowOfTerm[i] < rows; ++c)
               sum += weights[i] * upstream[i / mixture.perSample * columns + c] * moved[rowOfTerm[i] * columns + c];
           return sum;
         };
         return std::vector<GradientPair>{
             {"input", stage.device.read(a.inputGradients.data),
              centralDifferences(loss, toDoubles(input), 0.5, firstIndices(input.size()))}};
       }});
  return tests;
}

}  // namespace tessera::device_test
