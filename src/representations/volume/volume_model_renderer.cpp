#include "representations/volume/volume_model_renderer.h"

#include <algorithm>
#include <limits>

namespace tessera {
namespace {

constexpr uint32_t kRays = 2048;  // of one piece of the picture

// Room for every corner of every sample: no picture lacks texels.
VolumePass::Room roomFor(const VolumeModel& model) {
  BlockSamples most{model.space()};
  most.intervals = static_cast<uint32_t>(model.config().samples);
  most.split = true;
  VolumePass::Room room;
  room.rays = kRays;
  room.texels = VirtualGrid::kCorners * most.mostSamples(kRays);
  return room;
}

}  // namespace

VolumeModelRenderer::VolumeModelRenderer(VolumeModel& model, float minAlpha)
    : model_(model), minAlpha_(minAlpha), pass_(model, roomFor(model)) {
  Device& device = model.device();
  cameraOfRay_ = device.array<uint32_t>(kRays);
  pixels_ = device.array<float>(kRays * 2);
  for (Array<float>* three : {&origins_, &directions_}) *three = device.array<float>(kRays * 3);
  far_ = device.array<float>(kRays);
}

std::string VolumeModelRenderer::device() const {
  return model_.device().name();
}

RenderedView VolumeModelRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  Device& device = model_.device();
  const RayCamera rayCamera = makeRayCamera(camera, worldFromCamera, model_.frame());
  const Array<RayCamera> cameras = device.arrayOf(std::vector<RayCamera>{rayCamera});
  const float* forward = rayCamera.rotation;  // third column, at 2, 5, 8
  const float scale = static_cast<float>(model_.frame().scale);
  RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                    ImageF(camera.width, camera.height, 1)};
  const size_t pixelCount = view.opacity.pixels.size();
  VolumePass::Options options;
  options.minAlpha = minAlpha_;
  std::vector<float> pixels, far;
  for (size_t first = 0; first < pixelCount; first += kRays) {
    const uint32_t rays = static_cast<uint32_t>(std::min<size_t>(kRays, pixelCount - first));
    pixels.clear();
    for (size_t i = first; i < first + rays; ++i) {
      pixels.push_back(static_cast<float>(i % camera.width) + 0.5f);
      pixels.push_back(static_cast<float>(i / camera.width) + 0.5f);
    }
    device.write(pixels_.all(), std::span<const float>(pixels));
    device.run(GenerateRays{{rays, {}}, cameras, cameraOfRay_, pixels_, origins_, directions_});
    const std::vector<float> directions = device.read(directions_.all());
    const auto cosine = [&](size_t ray) {
      return directions[3 * ray] * forward[2] + directions[3 * ray + 1] * forward[5] +
             directions[3 * ray + 2] * forward[8];
    };
    VolumeRays volumeRays{rays, origins_, directions_, {}, {}, {}};
    if (opaqueDepth != nullptr) {
      far.clear();
      for (size_t ray = 0; ray < rays; ++ray) {
        const float depth = opaqueDepth->pixels[first + ray], along = cosine(ray);
        far.push_back(along > 0 ? depth * scale / along : std::numeric_limits<float>::infinity());
      }
      device.write(far_.all(), std::span<const float>(far));
      volumeRays.far = far_;
    }
    pass_.forward(volumeRays, options);
    const std::vector<float> colour = device.read(pass_.colour().part(0, size_t{rays} * 3));
    const std::vector<float> opacity = device.read(pass_.opacity().part(0, rays));
    const std::vector<float> depth = device.read(pass_.depth().part(0, rays));
    std::copy(colour.begin(), colour.end(), view.colour.pixels.begin() + static_cast<ptrdiff_t>(first * 3));
    std::copy(opacity.begin(), opacity.end(), view.opacity.pixels.begin() + static_cast<ptrdiff_t>(first));
    for (uint32_t ray = 0; ray < rays; ++ray) view.depth.pixels[first + ray] = depth[ray] * cosine(ray) / scale;
  }
  return view;
}

}  // namespace tessera
