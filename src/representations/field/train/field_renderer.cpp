#include "representations/field/train/field_renderer.h"

#include <algorithm>

#include "compute/composite.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 4096;        // maximum in one batch of the image's rays
constexpr uint32_t kSamples = 1 << 16;  // rays whose samples do not fit are rendered in the next batch
static_assert(kSamples >= FieldConfig::kMaxSteps);

}  // namespace

FieldRenderer::FieldRenderer(FieldModel& model) : model_(model), pictureRays_(model.device(), kRays) {
  Device& device = model.device();
  seen_ = RaySamples(device, kRays, kSamples);
  counters_ = device.array<uint32_t>(RaySamples::kCounters);
  seen_.counters = counters_;
  colour_ = device.array<float>(kRays * 3);
  for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(kRays);
  weights_ = device.array<float>(kSamples);
}

std::string FieldRenderer::device() const {
  return model_.device().name();
}

RenderedView FieldRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  pictureRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(),
                     PixelLattice::whole(camera), opaqueDepth);
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  const size_t pixelCount = view.opacity.pixels.size();
  uint32_t nextRays = 1024;  // rays of the next batch, predicted from the samples of the last one
  for (size_t first = 0; first < pixelCount;) {
    const PictureRays::Piece piece = pictureRays_.piece(first, nextRays);
    model_.sample({piece.rays, piece.origins, piece.directions, {}, piece.far}, kMinTransmittance, seen_);
    const RadianceField::Output output =
        model_.field().forward(seen_.samples(), seen_.positions, piece.directions, seen_.rayOfSample, false);
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
    device.run(composite);
    const RoundCounts counts(device.read(counters_.all()), RaySamples::kRounds);
    const uint32_t finished = counts.finished;
    CHECK(finished >= 1u);  // one ray's steps always fit
    const std::vector<float> colour = device.read(colour_.part(0, size_t{finished} * 3));
    const std::vector<float> opacity = device.read(opacity_.part(0, finished));
    const std::vector<float> depth = device.read(depth_.part(0, finished));
    std::copy(colour.begin(), colour.end(), view.colour.pixels.begin() + static_cast<ptrdiff_t>(first * 3));
    std::copy(opacity.begin(), opacity.end(), view.opacity.pixels.begin() + static_cast<ptrdiff_t>(first));
    for (uint32_t ray = 0; ray < finished; ++ray)
      view.depth.pixels[first + ray] = pictureRays_.toViewDepth(ray, depth[ray]);
    first += finished;
    samples_ += counts.visibleSamples;
    // Each round of marching, and the set of visible samples, has a capacity of kSamples.
    const double fitting = 0.9 * kSamples / std::max(1.0, counts.fullest / (1.0 * finished));
    nextRays = static_cast<uint32_t>(std::clamp(fitting, 64.0, static_cast<double>(kRays)));
  }
  return view;
}

}  // namespace tessera
