#include "representations/volume/train/volume_model_renderer.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr uint32_t kRays = 512;  // of one piece of the picture
// The model is judged here, not the haste with which it was trained, and a scene baked from it draws whatever a ray
// meets: so there are more samples than in training, and a good part of them lies where proposals expect nothing, as
// fog may stand there. Of nadir photos (64 samples, a padding of 0.3) that is worth 0.17 dB; in a city nothing changes.
constexpr uint32_t kTimesAsMany = 4;
constexpr float kPadding = 0.3f;

// Room for every corner of every sample: no picture lacks texels.
VolumePass::Room roomFor(const VolumeModel& model) {
  BlockSamples most{model.space()};
  most.intervals = kTimesAsMany * static_cast<uint32_t>(model.config().samples);
  most.split = true;
  VolumePass::Room room;
  room.samples = most.intervals;
  room.rays = kRays;
  room.texels = VirtualGrid::kCorners * most.mostSamples(kRays);
  return room;
}

}  // namespace

VolumeModelRenderer::VolumeModelRenderer(VolumeModel& model, float minAlpha)
    : model_(model), minAlpha_(minAlpha), pass_(model, roomFor(model)), pictureRays_(model.device(), kRays) {}

std::string VolumeModelRenderer::device() const {
  return model_.device().name();
}

RenderedView VolumeModelRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  pictureRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(),
                     PixelLattice::whole(camera), opaqueDepth);
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  VolumePass::Options options;
  options.minAlpha = minAlpha_;
  options.padding = kPadding;
  for (size_t first = 0; first < view.opacity.pixels.size(); first += kRays) {
    const PictureRays::Piece piece = pictureRays_.piece(first, kRays);
    pass_.forward({piece.rays, piece.origins, piece.directions, {}, piece.far, {}}, options);
    const std::vector<float> colour = device.read(pass_.colour().part(0, size_t{3} * piece.rays));
    const std::vector<float> opacity = device.read(pass_.opacity().part(0, piece.rays));
    const std::vector<float> depth = device.read(pass_.depth().part(0, piece.rays));
    std::copy(colour.begin(), colour.end(), view.colour.pixels.begin() + static_cast<ptrdiff_t>(first * 3));
    std::copy(opacity.begin(), opacity.end(), view.opacity.pixels.begin() + static_cast<ptrdiff_t>(first));
    for (uint32_t ray = 0; ray < piece.rays; ++ray) {
      view.depth.pixels[first + ray] = pictureRays_.depthOf(ray, depth[ray]);
    }
  }
  return view;
}

}  // namespace tessera
