#include "representations/hash/train/hash_model_renderer.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr uint32_t kRays = 4096;        // of one piece of the picture, at most
constexpr uint32_t kSamples = 1 << 16;  // rays that do not fit are taken up by the next piece
static_assert(kSamples >= HashModel::kMostSteps);
constexpr float kDrawingMinTransmittance = 2e-3f;

// Room for every corner of every sample: no picture lacks any.
HashPass::Room room() {
  return {kRays, kSamples, 8 * kSamples, false};
}

}  // namespace

HashModelRenderer::HashModelRenderer(HashModel& model)
    : model_(model), pass_(model, room()), pictureRays_(model.device(), kRays) {}

std::string HashModelRenderer::device() const {
  return model_.device().name();
}

RenderedView HashModelRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  pictureRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(),
                     PixelLattice::whole(camera), opaqueDepth);
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  const bool learned = model_.config().background == "learned";
  const size_t pixelCount = view.opacity.pixels.size();
  uint32_t wanted = 1024;  // rays of the next piece: as many as the last one's samples let expect
  for (size_t first = 0; first < pixelCount;) {
    const PictureRays::Piece piece = pictureRays_.piece(first, wanted);
    const HashModel::Rays rays{piece.rays, piece.origins, piece.directions, {}, {}, piece.far};
    pass_.forward(rays, kDrawingMinTransmittance);
    const RoundCounts counts(device.read(pass_.counters()), HashSamples::kRounds);
    const uint32_t finished = counts.finished;
    CHECK(finished >= 1u);  // one ray's steps always fit
    const std::vector<float> colour = device.read(pass_.colour().part(0, size_t{finished} * 3));
    const std::vector<float> opacity = device.read(pass_.opacity().part(0, finished));
    const std::vector<float> depth = device.read(pass_.depth().part(0, finished));
    for (uint32_t ray = 0; ray < finished; ++ray) {
      const size_t pixel = first + ray;
      // What the network says of a direction stands for all that is behind, unless something else is known to be.
      const bool whole = learned && (opaqueDepth == nullptr || !std::isfinite(opaqueDepth->pixels[pixel]));
      const float share = learned && !whole ? opacity[ray] : 1;
      for (size_t c = 0; c < 3; ++c) view.colour.pixels[3 * pixel + c] = share * colour[3 * ray + c];
      view.opacity.pixels[pixel] = whole ? 1 : opacity[ray];
      const float seenDepth = whole ? depth[ray] / std::max(opacity[ray], 1e-6f) : depth[ray];
      view.depth.pixels[pixel] = pictureRays_.depthOf(ray, seenDepth);
    }
    first += finished;
    // Each round of marching has room for so many samples, and so has what is seen.
    const double fitting = 0.9 * kSamples / std::max(1.0, counts.fullest / (1.0 * finished));
    wanted = static_cast<uint32_t>(std::clamp(fitting, 64.0, static_cast<double>(kRays)));
  }
  return view;
}

}  // namespace tessera
