#include "representations/volume/train/volume_model_renderer.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr uint32_t kRays = 512;  // per batch
// This renderer evaluates the model, not the economies of its training, and a scene baked from it draws whatever a ray
// meets. So it takes more samples than training does, and a good part of them where proposals expect nothing, because
// fog may be there. For nadir photos (64 samples, a uniform fraction of 0.3) that is worth 0.17 dB; in a city nothing
// changes.
constexpr uint32_t kTimesAsMany = 4;
constexpr float kUniformFraction = 0.3f;

// Returns a capacity for every corner of every sample, so that no image lacks texels.
VolumePipeline::Capacity makeCapacity(const VolumeModel& model) {
  BlockSamples maximum{model.space()};
  maximum.intervals = kTimesAsMany * static_cast<uint32_t>(model.config().samples);
  maximum.split = true;
  VolumePipeline::Capacity capacity;
  capacity.samples = maximum.intervals;
  capacity.rays = kRays;
  capacity.texels = VirtualGrid::kCorners * maximum.maxSamples(kRays);
  return capacity;
}

}  // namespace

VolumeModelRenderer::VolumeModelRenderer(VolumeModel& model, float minAlpha)
    : model_(model), minAlpha_(minAlpha), pipeline_(model, makeCapacity(model)), imageRays_(model.device(), kRays) {}

std::string VolumeModelRenderer::device() const {
  return model_.device().name();
}

RenderedView VolumeModelRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  imageRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(), PixelLattice::whole(camera),
                   opaqueDepth);
  RenderedView view = makeEmptyView(camera);
  VolumePipeline::Options options;
  options.minAlpha = minAlpha_;
  options.uniformFraction = kUniformFraction;
  for (size_t first = 0; first < view.opacity.pixels.size(); first += kRays) {
    const ImageRays::Piece piece = imageRays_.piece(first, kRays);
    pipeline_.forward({piece.rays, piece.origins, piece.directions, {}, piece.far, {}}, options);
    const std::vector<float> colour = device.read(pipeline_.colour().part(0, size_t{3} * piece.rays));
    const std::vector<float> opacity = device.read(pipeline_.opacity().part(0, piece.rays));
    const std::vector<float> depth = device.read(pipeline_.depth().part(0, piece.rays));
    std::copy(colour.begin(), colour.end(), view.colour.pixels.begin() + static_cast<ptrdiff_t>(first * 3));
    std::copy(opacity.begin(), opacity.end(), view.opacity.pixels.begin() + static_cast<ptrdiff_t>(first));
    for (uint32_t ray = 0; ray < piece.rays; ++ray) {
      view.depth.pixels[first + ray] = imageRays_.toViewDepth(ray, depth[ray]);
    }
  }
  return view;
}

}  // namespace tessera
