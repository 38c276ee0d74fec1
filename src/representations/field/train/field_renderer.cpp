#include "representations/field/train/field_renderer.h"

#include <algorithm>

#include "compute/composite.h"
#include "train/photo_visitor.h"

namespace tessera {
namespace {

static_assert(ImageBatch::kLeastSamples >= FieldConfig::kMaxSteps);  // so that the samples of any ray fit

}  // namespace

// Marks the cells with samples that contribute to a pixel of a photo.
class FieldRenderer::SeenCells final : public PixelVisitor {
 public:
  SeenCells(FieldRenderer& renderer, const CullOptions& options)
      : marked(renderer.model_.occupancy().cells() / 32),
        resolution_(renderer.model_.space().gridResolution),
        renderer_(renderer),
        options_(options) {}

  void begin(const Photo& photo, const Camera& camera) override {
    const SceneFrame& frame = renderer_.model_.frame();
    renderer_.imageRays_.begin(makeRayCamera(camera, photo.worldFromCamera, frame), frame, {});
  }
  void visit(std::span<const float> pixels, SeenThrough) override {
    while (!pixels.empty()) {  // rays whose samples do not fit are rendered in the next batch
      pixels = pixels.subspan(size_t{2} * markSamples(renderer_.renderPiece(renderer_.imageRays_.through(pixels))));
    }
  }

  std::vector<uint32_t> marked;  // as OccupancyGrid::bits

 private:
  // Returns the number of rays whose samples were marked.
  uint32_t markSamples(const RoundCounts& counts) {
    Device& device = renderer_.model_.device();
    const RaySamples& seen = renderer_.seen_;
    const std::vector<uint32_t> first = device.read(seen.firstSample.part(0, counts.finished + size_t{1}));
    const std::vector<float> positions = device.read(seen.positions.part(0, size_t{3} * counts.visibleSamples));
    const std::vector<float> weights = device.read(renderer_.weights_.part(0, counts.visibleSamples));
    for (uint32_t ray = 0; ray < counts.finished; ++ray) {
      float transmittance = 1;
      for (uint32_t s = first[ray]; s < first[ray + 1]; ++s) {
        const float alpha = weights[s] / std::max(transmittance, 1e-9f);
        transmittance -= weights[s];
        if (weights[s] > options_.minWeight && alpha > options_.minAlpha) mark(cell(&positions[size_t{3} * s]));
      }
    }
    return counts.finished;
  }
  void mark(size_t cell) { marked[cell / 32] |= 1u << (cell % 32); }
  size_t cell(const float position[3]) const {
    size_t number = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const int along = static_cast<int>(static_cast<double>(position[axis]) * resolution_);
      number = number * static_cast<size_t>(resolution_) + static_cast<size_t>(std::clamp(along, 0, resolution_ - 1));
    }
    return number;
  }

  int resolution_;
  FieldRenderer& renderer_;
  CullOptions options_;
};

FieldRenderer::FieldRenderer(FieldModel& model)
    : model_(model), batch_(ImageBatch::on(model.device())), imageRays_(model.device(), batch_.rays) {
  Device& device = model.device();
  seen_ = RaySamples(device, batch_.rays, batch_.samples);
  counters_ = device.array<uint32_t>(RaySamples::kCounters);
  seen_.counters = counters_;
  colour_ = device.array<float>(size_t{3} * batch_.rays);
  for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(batch_.rays);
  weights_ = device.array<float>(batch_.samples);
}

std::string FieldRenderer::device() const {
  return model_.device().name();
}

RoundCounts FieldRenderer::renderPiece(const ImageRays::Piece& piece) {
  const RadianceField::Output output =
      model_.render({piece.rays, piece.origins, piece.directions, {}, piece.far}, cells(), kMinTransmittance, seen_);
  CompositeForward composite;
  composite.minTransmittance = kMinTransmittance;
  composite.rays = seen_.finished(piece.rays);
  composite.firstSample = seen_.firstSample;
  composite.x = output.logDensity;
  composite.steps = seen_.steps;
  composite.distances = seen_.distances;
  composite.colours = output.colours;
  composite.colour = colour_;
  composite.opacity = opacity_;
  composite.depth = depth_;
  composite.weights = weights_;
  model_.device().run(composite);
  const RoundCounts counts(model_.device().read(counters_.all()), RaySamples::kRounds);
  CHECK(counts.finished >= 1u);  // one ray's steps always fit
  densities_ += counts.marched;
  colours_ += counts.visibleSamples;
  return counts;
}

void FieldRenderer::cullUnseen(const Capture& capture, const CullOptions& options,
                               const std::function<void(int64_t done, int64_t all)>& onPhoto) {
  SeenCells seen(*this, options);
  PhotoVisitor(capture, model_.frame(), batch_.rays, seen).visitAll(options.stride, {}, onPhoto);
  const auto cells = static_cast<uint32_t>(model_.space().gridResolution);
  for (int i = 0; i < options.dilation; ++i) seen.marked = dilateCells(seen.marked, cells);
  std::vector<uint32_t> bits = model_.occupancy().bitWords();
  for (size_t word = 0; word < bits.size(); ++word) bits[word] &= seen.marked[word];
  seenCells_ = model_.device().uploadArray(bits);
}

RenderedView FieldRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  imageRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(), PixelLattice::whole(camera),
                   opaqueDepth);
  RenderedView view = makeEmptyView(camera);
  imageRays_.renderInPieces(batch_.samples, [&](const ImageRays::Piece& piece, size_t first) {
    const RoundCounts counts = renderPiece(piece);
    const uint32_t finished = counts.finished;
    const std::vector<float> colour = device.read(colour_.part(0, size_t{finished} * 3));
    const std::vector<float> opacity = device.read(opacity_.part(0, finished));
    const std::vector<float> depth = device.read(depth_.part(0, finished));
    std::copy(colour.begin(), colour.end(), view.colour.pixels.begin() + static_cast<ptrdiff_t>(first * 3));
    std::copy(opacity.begin(), opacity.end(), view.opacity.pixels.begin() + static_cast<ptrdiff_t>(first));
    for (uint32_t ray = 0; ray < finished; ++ray)
      view.depth.pixels[first + ray] = imageRays_.toViewDepth(ray, depth[ray]);
    // Each round of marching, and the set of visible samples, has the same capacity.
    return ImageRays::Rendered{finished, static_cast<uint32_t>(counts.fullest)};
  });
  return view;
}

}  // namespace tessera
