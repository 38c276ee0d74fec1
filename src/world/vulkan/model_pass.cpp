#include "world/vulkan/model_pass.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "shaders/model_triangles.h"
#include "shaders/shade_models.h"
#include "shaders/world/arguments_world.h"

namespace tessera {
namespace {

constexpr ImageFormat kColourFormat = ImageFormat::rgba8, kDepthFormat = ImageFormat::r32Float;
constexpr float kNearModels = 0.01f;  // world units along the axis; nothing nearer is drawn

GraphicsPipelineOptions modelPipelineOptions() {
  GraphicsPipelineOptions options;
  options.colours = {{kColourFormat}, {kDepthFormat}};
  options.depth = ImageFormat::depth32Float;
  options.depthCompare = VK_COMPARE_OP_GREATER;
  return options;
}

// Returns the texels of an image and of all smaller levels of it, the last of which is one texel.
std::vector<uint32_t> texelsOfLevels(ImageU8 image, uint32_t& levels) {
  std::vector<uint32_t> texels;
  for (levels = 1;; ++levels) {
    for (size_t p = 0; p < image.pixelCount(); ++p) {
      const uint8_t* at = image.pixels.data() + 4 * p;
      texels.push_back(at[0] | uint32_t{at[1]} << 8 | uint32_t{at[2]} << 16 | uint32_t{at[3]} << 24);
    }
    if (image.width == 1 && image.height == 1) return texels;
    image = downscaleByArea(image, std::max(image.width / 2, 1), std::max(image.height / 2, 1));
  }
}

void copyMatrix(const Mat3d& from, float* to) {
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) to[3 * row + column] = static_cast<float>(from(row, column));
}

}  // namespace

ModelPass::ModelPass(std::shared_ptr<GpuStream> stream, std::span<const Model> models, std::vector<PlacedModel> placed)
    : stream_(std::move(stream)),
      pipeline_(stream_->context(), kModelTrianglesSpirv, kShadeModelsSpirv, modelPipelineOptions()),
      placed_(std::move(placed)) {
  for (const Model& model : models) models_.push_back(upload(model));
}

ModelPass::~ModelPass() {
  try {
    stream_->finish();
  } catch (const std::exception&) {  // the device is lost
  }
}

template <class T>
GpuBuffer ModelPass::upload(const std::vector<T>& values) {
  const auto bytes = std::as_bytes(std::span(values));
  GpuBuffer buffer = stream_->makeBuffer(std::max<size_t>(bytes.size(), 16));
  if (!bytes.empty()) stream_->upload(buffer, 0, bytes);
  bytes_ += bytes.size();
  return buffer;
}

ModelPass::Uploaded ModelPass::upload(const Model& model) {
  static_assert(sizeof(ModelVertex) == 40);
  Uploaded uploaded;
  uploaded.vertices = upload(model.vertices);
  uploaded.corners = upload(model.corners);
  uploaded.count = static_cast<uint32_t>(model.corners.size());
  std::vector<arguments::ModelTextureArguments> textures;
  for (const ImageU8& image : model.textures) {
    uint32_t levels = 0;
    uploaded.texels.push_back(upload(texelsOfLevels(image, levels)));
    textures.push_back({uploaded.texels.back().address(), static_cast<uint32_t>(image.width),
                        static_cast<uint32_t>(image.height), levels, 0});
  }
  uploaded.textures = upload(textures);
  std::vector<arguments::ModelMaterialArguments> materials;
  for (const ModelMaterial& material : model.materials) {
    arguments::ModelMaterialArguments& to = materials.emplace_back();
    std::copy(material.baseColour.begin(), material.baseColour.end(), to.baseColour);
    std::copy(material.emission.begin(), material.emission.end(), to.emission);
    to.opacity = material.opacity;
    to.cutoff = material.cutoff;
    to.metalness = material.metalness;
    to.roughness = material.roughness;
    to.texture = static_cast<uint32_t>(material.texture + 1);
    to.surfaceTexture = static_cast<uint32_t>(material.surfaceTexture + 1);
    to.emissionTexture = static_cast<uint32_t>(material.emissionTexture + 1);
    to.isDoubleSided = material.isDoubleSided ? 1 : 0;
    to.isLit = material.isLit ? 1 : 0;
  }
  uploaded.materials = upload(materials);
  return uploaded;
}

void ModelPass::ensureTarget(const Camera& camera) {
  const ImageSize size = {static_cast<uint32_t>(camera.width), static_cast<uint32_t>(camera.height)};
  if (colourImage_ && colourImage_->size() == size) return;
  if (pass_) stream_->deferDestroy(std::move(pass_));
  for (auto* image : {&colourImage_, &depthImage_})
    if (*image) stream_->deferDestroy(std::move(*image));
  colourImage_ = stream_->makeImage(size, kColourFormat);
  depthImage_ = stream_->makeImage(size, kDepthFormat);
  const std::shared_ptr<GpuImage> test = stream_->makeImage(size, ImageFormat::depth32Float);
  pass_ = std::make_shared<GpuRenderPass>(
      stream_->context(), std::vector<ColourAttachment>{{.image = colourImage_}, {.image = depthImage_}},
      DepthAttachment{.image = test, .clearDepth = 0, .isStored = false});
  const std::pair<GpuBuffer*, size_t> buffers[] = {{&colours_, colourImage_->copiedBytes()},
                                                   {&depths_, depthImage_->copiedBytes()}};
  for (const auto& [buffer, bytes] : buffers) {
    if (buffer->bytes() >= bytes) continue;
    if (*buffer) stream_->deferDestroy(std::move(*buffer));
    *buffer = GpuBuffer();
    *buffer = stream_->makeBuffer(bytes);
  }
}

void ModelPass::draw(const Camera& camera, const Pose& worldFromCamera) {
  if (!isPinhole(camera.lens)) {
    throw Error(std::string(lensName(camera.lens)), "", "models are drawn without distortion only",
                "use a pinhole camera");
  }
  ensureTarget(camera);
  std::vector<arguments::DrawModelArguments> all(placed_.size());
  std::vector<DrawCall> draws;
  const Mat3d cameraFromWorld = worldFromCamera.rotation.transpose();
  for (size_t i = 0; i < placed_.size(); ++i) {
    const PlacedModel& placed = placed_[i];
    const Uploaded& model = models_[placed.model];
    arguments::DrawModelArguments& to = all[i];
    copyMatrix(placed.rotation * placed.scale.asDiagonal(), to.worldFromModel);
    copyMatrix(placed.rotation * placed.scale.cwiseInverse().asDiagonal(), to.normalFromModel);
    copyMatrix(cameraFromWorld, to.cameraFromWorld);
    const Vec3d shift = placed.position - worldFromCamera.translation;
    for (int axis = 0; axis < 3; ++axis) to.shift[axis] = static_cast<float>(shift[axis]);
    to.focal[0] = static_cast<float>(camera.focalX());
    to.focal[1] = static_cast<float>(camera.focalY());
    to.centre[0] = static_cast<float>(camera.centreX());
    to.centre[1] = static_cast<float>(camera.centreY());
    to.near = kNearModels;
    to.width = static_cast<uint32_t>(camera.width);
    to.height = static_cast<uint32_t>(camera.height);
    to.vertices = model.vertices.address();
    to.corners = model.corners.address();
    to.materials = model.materials.address();
    to.textures = model.textures.address();
    draws.push_back({&pipeline_, std::as_bytes(std::span(&to, 1)), {.vertices = model.count}});
  }
  stream_->draw(*pass_, draws);
  stream_->copy(*colourImage_, colours_, 0);
  stream_->copy(*depthImage_, depths_, 0);
}

}  // namespace tessera
