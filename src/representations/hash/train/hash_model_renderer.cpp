#include "representations/hash/train/hash_model_renderer.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

static_assert(ImageBatch::kLeastSamples >= HashModel::kMaxSteps);  // so that the samples of any ray fit
constexpr float kDrawingMinTransmittance = 2e-3f;

// The capacity is sufficient for every corner of every sample, so that no image lacks any.
HashPipeline::Capacity capacity(const ImageBatch& batch) {
  return {batch.rays, batch.samples, 8 * batch.samples, false};
}

}  // namespace

HashModelRenderer::HashModelRenderer(HashModel& model)
    : model_(model),
      batch_(ImageBatch::on(model.device())),
      pipeline_(model, capacity(batch_)),
      imageRays_(model.device(), batch_.rays) {}

std::string HashModelRenderer::device() const {
  return model_.device().name();
}

RenderedView HashModelRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  imageRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(), PixelLattice::whole(camera),
                   opaqueDepth);
  RenderedView view = makeEmptyView(camera);
  const bool learned = model_.config().background == "learned";
  imageRays_.renderInPieces(batch_.samples, [&](const ImageRays::Piece& piece, size_t first) {
    const HashModel::Rays rays{piece.rays, piece.origins, piece.directions, {}, {}, piece.far};
    pipeline_.forward(rays, kDrawingMinTransmittance);
    const RoundCounts counts(device.read(pipeline_.counters()), HashSamples::kRounds);
    const uint32_t finished = counts.finished;
    CHECK(finished >= 1u);  // one ray's steps always fit
    const std::vector<float> colour = device.read(pipeline_.colour().part(0, size_t{finished} * 3));
    const std::vector<float> opacity = device.read(pipeline_.opacity().part(0, finished));
    const std::vector<float> depth = device.read(pipeline_.depth().part(0, finished));
    for (uint32_t ray = 0; ray < finished; ++ray) {
      const size_t pixel = first + ray;
      // The learned background makes the pixel opaque, unless an opaque object is known to stand at the ray's end.
      const bool isOpaque = learned && (opaqueDepth == nullptr || !std::isfinite(opaqueDepth->pixels[pixel]));
      const float share = learned && !isOpaque ? opacity[ray] : 1;
      for (size_t c = 0; c < 3; ++c) view.colour.pixels[3 * pixel + c] = share * colour[3 * ray + c];
      view.opacity.pixels[pixel] = isOpaque ? 1 : opacity[ray];
      const float seenDepth = isOpaque ? depth[ray] / std::max(opacity[ray], 1e-6f) : depth[ray];
      view.depth.pixels[pixel] = imageRays_.toViewDepth(ray, seenDepth);
    }
    // Each round of marching, and the set of visible samples, has the same capacity.
    return ImageRays::Rendered{finished, static_cast<uint32_t>(counts.fullest)};
  });
  return view;
}

}  // namespace tessera
