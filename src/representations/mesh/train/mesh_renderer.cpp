#include "representations/mesh/train/mesh_renderer.h"

#include <algorithm>

#include "compute/composite.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 4096;        // maximum in one batch of the image's rays
constexpr uint32_t kSamples = 1 << 16;  // rays whose hits do not fit are rendered in the next batch
constexpr uint32_t kMaxHits = 1 << 12;  // of a ray
constexpr float kMinTransmittance = 1e-3f;

}  // namespace

MeshRenderer::MeshRenderer(MeshModel& model, uint32_t level)
    : model_(model),
      level_(level),
      imageRays_(model.device(), kRays),
      hits_(model.device(), kRays, kSamples),
      counters_(model.device().array<uint32_t>(MeshHits::kCounters)) {
  Device& device = model.device();
  hits_.counters = counters_;
  model.field().reserve(kSamples);
  colour_ = device.array<float>(kRays * 3);
  for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(kRays);
  weights_ = device.array<float>(kSamples);
}

std::vector<uint32_t> MeshRenderer::renderPiece(const ImageRays::Piece& piece) {
  model_.level(level_).trace({piece.rays, piece.origins, piece.directions, piece.far}, kMaxHits, hits_);
  const MeshField::Output output =
      model_.field().forward(hits_.samples(), hits_.positions, piece.directions, hits_.rayOfSample, false);
  CompositeForward composite;
  composite.extinction = Extinction::logit;
  composite.offset = model_.opacityOffset();
  composite.minTransmittance = kMinTransmittance;
  composite.rays = hits_.finished(piece.rays);
  composite.firstSample = hits_.firstSample;
  composite.x = output.logits;
  composite.distances = hits_.distances;
  composite.colours = output.colours;
  composite.colour = colour_;
  composite.opacity = opacity_;
  composite.depth = depth_;
  composite.weights = weights_;
  model_.device().run(composite);
  return model_.device().read(counters_.all());
}

RenderedView MeshRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  imageRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(), PixelLattice::whole(camera),
                   opaqueDepth);
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  const size_t pixelCount = view.opacity.pixels.size();
  uint32_t nextRays = 1024;  // rays of the next batch, predicted from the hits of the last one
  for (size_t first = 0; first < pixelCount;) {
    const std::vector<uint32_t> counters = renderPiece(imageRays_.piece(first, nextRays));
    const uint32_t finished = counters[1];
    CHECK(finished >= 1u);  // one ray's hits always fit
    const std::vector<float> colour = device.read(colour_.part(0, size_t{finished} * 3));
    const std::vector<float> opacity = device.read(opacity_.part(0, finished));
    const std::vector<float> depth = device.read(depth_.part(0, finished));
    std::copy(colour.begin(), colour.end(), view.colour.pixels.begin() + static_cast<ptrdiff_t>(first * 3));
    std::copy(opacity.begin(), opacity.end(), view.opacity.pixels.begin() + static_cast<ptrdiff_t>(first));
    for (uint32_t ray = 0; ray < finished; ++ray)
      view.depth.pixels[first + ray] = imageRays_.toViewDepth(ray, depth[ray]);
    first += finished;
    const double fitting = 0.9 * kSamples / std::max(1.0, counters[0] / (1.0 * finished));
    nextRays = static_cast<uint32_t>(std::clamp(fitting, 64.0, static_cast<double>(kRays)));
  }
  return view;
}

}  // namespace tessera
