#include "representations/mesh/train/mesh_renderer.h"

#include <algorithm>
#include <cmath>

#include "compute/composite.h"
#include "compute/cube_map.h"

namespace tessera {
namespace {

constexpr uint32_t kMaxHits = 1 << 12;  // of a ray
constexpr float kMinTransmittance = 1e-3f;

// Adds what is behind `view`.
void addBehind(RenderedView& view, const RenderedView& behind) {
  for (size_t pixel = 0; pixel < view.opacity.pixels.size(); ++pixel) {
    const float transmittance = 1 - view.opacity.pixels[pixel];
    for (size_t c = 0; c < 3; ++c)
      view.colour.pixels[3 * pixel + c] += transmittance * behind.colour.pixels[3 * pixel + c];
    view.depth.pixels[pixel] += transmittance * behind.depth.pixels[pixel];
    view.opacity.pixels[pixel] += transmittance * behind.opacity.pixels[pixel];
  }
}

// Adds the sky, `colours`, behind a view, unless an opaque object is known to stand at the ray's end. Then the pixel is
// opaque, and its depth is the mean of the hits'.
void addSky(RenderedView& view, const ImageF& colours, const ImageF* opaqueDepth) {
  for (size_t pixel = 0; pixel < view.opacity.pixels.size(); ++pixel) {
    if (opaqueDepth != nullptr && std::isfinite(opaqueDepth->pixels[pixel])) continue;
    float& opacity = view.opacity.pixels[pixel];
    for (size_t c = 0; c < 3; ++c) view.colour.pixels[3 * pixel + c] += (1 - opacity) * colours.pixels[3 * pixel + c];
    if (opacity > 0) view.depth.pixels[pixel] /= opacity;
    opacity = 1;
  }
}

}  // namespace

MeshPartRenderer::MeshPartRenderer(MeshModel& model, uint32_t level)
    : model_(model),
      level_(level),
      batch_(ImageBatch::on(model.device())),
      imageRays_(model.device(), batch_.rays),
      hits_(model.device(), batch_.rays, batch_.samples),
      counters_(model.device().array<uint32_t>(MeshHits::kCounters)) {
  Device& device = model.device();
  hits_.counters = counters_;
  model.field().reserve(batch_.samples);
  for (Array<float>* perRay : {&colour_, &sky_}) *perRay = device.array<float>(size_t{3} * batch_.rays);
  for (Array<float>* perRay : {&opacity_, &depth_}) *perRay = device.array<float>(batch_.rays);
  weights_ = device.array<float>(batch_.samples);
}

std::vector<uint32_t> MeshPartRenderer::renderPiece(const ImageRays::Piece& piece) {
  Device& device = model_.device();
  model_.level(level_).trace({piece.rays, piece.origins, piece.directions, piece.far}, kMaxHits, true, hits_);
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
  device.run(composite);
  if (model_.part().isBackground()) {
    device.run(CubeMapForward{MeshModel::kSkyResolution, {piece.rays}, piece.directions, model_.sky().values, sky_});
  }
  return device.read(counters_.all());
}

RenderedView MeshPartRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  imageRays_.begin(makeRayCamera(camera, worldFromCamera, model_.frame()), model_.frame(), PixelLattice::whole(camera),
                   opaqueDepth);
  RenderedView view = makeEmptyView(camera);
  skyColours_ = model_.part().isBackground() ? ImageF(camera.width, camera.height, 3) : ImageF();
  imageRays_.renderInPieces(batch_.samples, [&](const ImageRays::Piece& piece, size_t first) {
    const std::vector<uint32_t> counters = renderPiece(piece);
    const uint32_t finished = counters[1];
    CHECK(finished >= 1u);  // one ray's hits always fit
    const std::vector<float> colour = device.read(colour_.part(0, size_t{finished} * 3));
    const std::vector<float> opacity = device.read(opacity_.part(0, finished));
    const std::vector<float> depth = device.read(depth_.part(0, finished));
    const std::vector<float> sky = device.read(sky_.part(0, size_t{finished} * 3));
    for (uint32_t ray = 0; ray < finished; ++ray) {
      const size_t pixel = first + ray;
      for (size_t c = 0; c < 3; ++c) {
        view.colour.pixels[3 * pixel + c] = colour[3 * ray + c];
        if (!skyColours_.empty()) skyColours_.pixels[3 * pixel + c] = sky[3 * ray + c];
      }
      view.opacity.pixels[pixel] = opacity[ray];
      view.depth.pixels[pixel] = imageRays_.toViewDepth(ray, depth[ray]);
    }
    return ImageRays::Rendered{finished, counters[0]};
  });
  return view;
}

MeshRenderer::MeshRenderer(TrainedMesh& mesh) : mesh_(mesh) {
  for (const auto& part : mesh.parts) parts_.push_back(std::make_unique<MeshPartRenderer>(*part));
}

bool MeshRenderer::showsOutside() const {
  return std::any_of(mesh_.parts.begin(), mesh_.parts.end(),
                     [](const auto& model) { return model->part().isBackground(); });
}

RenderedView MeshRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  RenderedView view = makeEmptyView(camera);
  const auto add = [&](int block) {
    for (size_t i = 0; i < parts_.size(); ++i) {
      if (mesh_.parts[i]->part().block != block) continue;
      addBehind(view, parts_[i]->render(camera, worldFromCamera, opaqueDepth));
      if (!parts_[i]->skyColours().empty()) addSky(view, parts_[i]->skyColours(), opaqueDepth);
    }
  };
  const Vec3d eye = mesh_.grid.inGrid(worldFromCamera.translation);
  for (const int block : mesh_.grid.frontToBack({eye.x(), eye.y()})) add(block);
  add(-1);
  return view;
}

}  // namespace tessera
