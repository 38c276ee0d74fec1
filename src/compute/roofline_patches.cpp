// The roofline rows of patches of texels: hits at random places of the faces, as in training, where the rays of a batch
// come from all photos.
#include <fmt/format.h>

#include <algorithm>

#include "base/random.h"
#include "compute/patches.h"
#include "compute/roofline_recorder.h"

namespace tessera {
namespace {

constexpr uint32_t kPatchEdge = 9, kPerHit = 4;
constexpr uint32_t kPatchFeatures = StoreTexelsForward::kFeatures, kPatchNumbers = StoreTexelsForward::kStored;

// The four texels around each hit, and the list of the distinct ones.
struct PatchBatch {
  uint32_t hits, patches, words, rowCount = 0;
  Array<uint32_t> patchOfFace, faces, texels, marks, ranks, counter, rowIds, rows;
  Array<float> barycentrics, weights;
  PatchTexels look;
  DistinctRows distinct;

  PatchBatch(RooflineRecorder& recorder, uint32_t count) : hits(count), patches(std::max(1u, count / 16)) {
    Device& device = recorder.device();
    const RandomStream random(1, 0x9a7c);
    std::vector<uint32_t> places(size_t{2} * patches), faceOfHit(hits);
    std::vector<float> shares;
    for (uint32_t face = 0; face < places.size(); ++face)
      places[face] = 16 * (face / 2) + (face % 2 ? kSecondTriangle : 0) + face % kPatchPermutations;
    for (uint32_t hit = 0; hit < hits; ++hit) {
      faceOfHit[hit] = random.below(3 * hit, 2 * patches);
      const float second = random.uniform(3 * hit + 1);
      shares.push_back(second);
      shares.push_back((1 - second) * random.uniform(3 * hit + 2));
    }
    patchOfFace = device.uploadArray(places);
    faces = device.uploadArray(faceOfHit);
    barycentrics = device.uploadArray(shares);
    texels = device.array<uint32_t>(size_t{kPerHit} * hits);
    weights = device.array<float>(size_t{kPerHit} * hits);
    look.samples = {hits};
    look.patchEdge = kPatchEdge;
    look.patchOfFace = patchOfFace;
    look.faces = faces;
    look.barycentrics = barycentrics;
    look.texels = texels;
    look.weights = weights;
    distinct.samples = {hits};
    distinct.ids = texels;
    distinct.idCount = patches * kPatchEdge * kPatchEdge;
    distinct.rowCapacity = kPerHit * hits;
    words = distinct.words();
    marks = device.array<uint32_t>(words);
    ranks = device.array<uint32_t>(words);
    counter = device.array<uint32_t>(1);
    rowIds = device.array<uint32_t>(distinct.rowCapacity);
    rows = device.array<uint32_t>(texels.size());
    distinct.marks = marks;
    distinct.ranks = ranks;
    distinct.rowCount = counter;
    distinct.rowIds = rowIds;
    distinct.rows = rows;
    device.run(look);
    device.run(distinct);
    rowCount = device.read(counter.all())[0];
  }
};

void measureStoring(RooflineRecorder& recorder, uint32_t rows) {
  Device& device = recorder.device();
  Array<float> features = recorder.randomFloats(size_t{kPatchFeatures} * rows, -3, 3),
               numbers = device.array<float>(size_t{kPatchNumbers} * rows);
  std::vector<float> bounds;
  for (uint32_t f = 0; f < kPatchFeatures; ++f) bounds.insert(bounds.end(), {-2, 2});
  Array<float> ranges = device.uploadArray(bounds);
  const std::string shape = fmt::format("{} texels", rows);
  StoreTexelsForward forward;
  forward.rows = {rows};
  forward.features = Matrix<float>(features, kPatchFeatures);
  forward.ranges = ranges;
  forward.stored = Matrix<float>(numbers, kPatchNumbers);
  recorder.measureStream(kOperation<StoreTexelsForward>, shape, rows * 4.0 * (kPatchFeatures + kPatchNumbers),
                         [&] { device.run(forward); });

  Array<float> gradients = device.array<float>(features.size());
  StoreTexelsBackward backward;
  backward.rows = {rows};
  backward.features = forward.features;
  backward.ranges = ranges;
  backward.storedGradients = Matrix<float>(numbers, kPatchNumbers);
  backward.featureGradients = Matrix<float>(gradients, kPatchFeatures);
  recorder.measureStream(kOperation<StoreTexelsBackward>, shape, rows * 4.0 * (2 * kPatchFeatures + kPatchNumbers),
                         [&] { device.run(backward); });
}

void measureMixing(RooflineRecorder& recorder, PatchBatch& batch) {
  Device& device = recorder.device();
  const uint32_t hits = batch.hits, rows = batch.rowCount;
  Array<float> numbers = recorder.randomFloats(size_t{kPatchNumbers} * rows, 0, 1),
               mixed = device.array<float>(size_t{kPatchNumbers} * hits);
  const std::string shape = fmt::format("{} hits, {} texels, {} columns", hits, rows, kPatchNumbers);
  MixRowsForward forward;
  forward.samples = {hits};
  forward.inputRows = {rows};
  forward.rows = batch.rows;
  forward.weights = batch.weights;
  forward.input = Matrix<float>(numbers, kPatchNumbers);
  forward.output = Matrix<float>(mixed, kPatchNumbers);
  recorder.measureStream(kOperation<MixRowsForward>, shape,
                         hits * (8.0 * kPerHit + 4.0 * kPatchNumbers) + rows * 4.0 * kPatchNumbers,
                         [&] { device.run(forward); });

  MixRowsBackward backward;
  backward.samples = forward.samples;
  backward.inputRows = forward.inputRows;
  backward.rows = batch.rows;
  backward.weights = batch.weights;
  backward.outputGradients = Matrix<float>(mixed, kPatchNumbers);
  backward.inputGradients = Matrix<float>(numbers, kPatchNumbers);
  recorder.measureStream(kOperation<MixRowsBackward>, shape,
                         hits * (8.0 * kPerHit + 4.0 * kPatchNumbers) + rows * 8.0 * kPatchNumbers,
                         [&] { device.run(backward); });
}

}  // namespace

void measurePatches(RooflineRecorder& recorder) {
  Device& device = recorder.device();
  PatchBatch batch(recorder, recorder.options().streamed / 4);
  const double hits = batch.hits;
  recorder.measureStream(kOperation<PatchTexels>, fmt::format("{} hits, {} patches", batch.hits, batch.patches),
                         hits * (12 + 8.0 * kPerHit) + batch.patches * 8.0, [&] { device.run(batch.look); });
  recorder.measureStream(kOperation<DistinctRows>,
                         fmt::format("{} hits, {} of {} texels", batch.hits, batch.rowCount, batch.distinct.idCount),
                         hits * 8.0 * kPerHit + batch.words * 8.0 + batch.rowCount * 4.0,
                         [&] { device.run(batch.distinct); });
  measureStoring(recorder, recorder.options().streamed / 4);
  measureMixing(recorder, batch);
}

}  // namespace tessera
