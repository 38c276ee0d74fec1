#include "world/vulkan/world_renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "shaders/add_scene.h"
#include "shaders/begin_world.h"
#include "shaders/world/arguments_world.h"

namespace tessera {
namespace {

constexpr size_t kNumbersOfPixel = 5;  // colour, opacity, depth
constexpr uint32_t kGroup = 64;        // local_size of the kernels
constexpr uint32_t kMaxGroups = 4096;  // each has several pixels of large images

Mat4d similarity(const Mat3d& turnedAndScaled, const Vec3d& translation) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = turnedAndScaled;
  matrix.topRightCorner<3, 1>() = translation;
  return matrix;
}

Mat4d worldFromScene(const TileFrame& frame) {
  return similarity(frame.scale * frame.rotation, frame.translation);
}

Mat4d boxFromWorld(const HiddenBox& box) {
  const Mat3d turn = Eigen::AngleAxisd(box.turn, Vec3d::UnitZ()).toRotationMatrix();
  return similarity(turn * box.size.asDiagonal(), box.middle).inverse();
}

// Returns the distance of a place in the world from the scene's box.
double distanceTo(const TileFrame& frame, const Vec3d& place) {
  const Vec3d x = frame.inScene(place);
  return frame.scale * (x - x.cwiseMax(frame.low).cwiseMin(frame.high)).norm();
}

}  // namespace

TileFrame placeFrame(const TileFrame& frame, const Placement& placement) {
  TileFrame placed = frame;
  placed.rotation = placement.rotation * frame.rotation;
  placed.scale = placement.scale * frame.scale;
  placed.translation = placement.position + placement.scale * (placement.rotation * frame.translation);
  return placed;
}

WorldRenderer::WorldRenderer(std::shared_ptr<GpuStream> stream, std::vector<Scene> scenes,
                             std::unique_ptr<ModelPass> models, const std::vector<HiddenBox>& hidden,
                             const Eigen::Array3f& background)
    : stream_(std::move(stream)),
      begin_(stream_->context(), kBeginWorldSpirv),
      addScene_(stream_->context(), kAddSceneSpirv),
      models_(std::move(models)),
      background_(background) {
  for (Scene& scene : scenes) scenes_.push_back({std::move(scene.renderer), scene.isMain});
  for (const HiddenBox& box : hidden) {
    if (box.hides) boxesFromWorld_.push_back(boxFromWorld(box));
  }
}

WorldRenderer::~WorldRenderer() {
  // After an exception, commands may be queued that use what is destroyed now, and another owner of the stream would
  // submit them later.
  try {
    stream_->finish();
  } catch (const std::exception&) {  // the device is lost
  }
  stream_->context()->waitIdle();
}

std::vector<size_t> WorldRenderer::farthestFirst(const Vec3d& eye) const {
  std::vector<size_t> order(scenes_.size());
  std::iota(order.begin(), order.end(), 0);
  std::vector<double> distances;
  for (const PlacedScene& scene : scenes_) distances.push_back(distanceTo(scene.renderer->frame(), eye));
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return distances[a] > distances[b]; });
  return order;
}

GpuSurroundings WorldRenderer::surroundingsAt(const std::vector<size_t>& farthestFirst, size_t place) const {
  GpuSurroundings around;
  around.wantsSurface = true;
  const size_t number = farthestFirst[place];
  around.endsRays = place == 0 && scenes_[number].isMain;
  around.withinBox = !scenes_[number].isMain;
  const Mat4d toWorld = worldFromScene(scenes_[number].renderer->frame());
  for (const Mat4d& box : boxesFromWorld_) around.hidden.push_back(box * toWorld);
  if (around.withinBox) return around;
  // Where another scene is captured, it is shown in place of this scene's background block; the nearest scenes come
  // first.
  for (auto other = farthestFirst.rbegin(); other != farthestFirst.rend(); ++other) {
    const TileFrame& frame = scenes_[*other].renderer->frame();
    if (*other == number || around.hiddenOfBackgroundBlock.size() == kMaxHiddenBoxes) continue;
    const Mat3d size = (frame.high - frame.low).asDiagonal();
    const Mat4d sceneFromCube = similarity(size, (frame.low + frame.high) / 2);
    around.hiddenOfBackgroundBlock.push_back((worldFromScene(frame) * sceneFromCube).inverse() * toWorld);
  }
  return around;
}

std::string WorldRenderer::whyNotThrough(const Camera& camera) const {
  return models_ && !isPinhole(camera.lens)
             ? fmt::format("has the lens {}, and models of a world are drawn without distortion", lensName(camera.lens))
             : "";
}

void WorldRenderer::ensureCapacity(const Camera& camera) {
  width_ = camera.width;
  height_ = camera.height;
  const size_t bytes = kNumbersOfPixel * sizeof(float) * static_cast<size_t>(width_) * static_cast<size_t>(height_);
  if (image_.bytes() >= bytes) return;
  if (image_) stream_->deferDestroy(std::move(image_));
  image_ = GpuBuffer();
  image_ = stream_->makeBuffer(bytes);
}

void WorldRenderer::queue(const Camera& camera, const Pose& worldFromCamera, bool exact) {
  // Forgotten until this image is complete: an exception leaves some scenes as they were.
  const std::optional<View> last = std::exchange(last_, std::nullopt);
  const bool isSame = last && camera == last->camera && worldFromCamera.rotation == last->worldFromCamera.rotation &&
                      worldFromCamera.translation == last->worldFromCamera.translation && exact == last->exact;
  ensureCapacity(camera);
  const uint32_t pixels = static_cast<uint32_t>(width_) * static_cast<uint32_t>(height_);
  const Groups groups = {workgroups(pixels, kGroup, kMaxGroups)};
  arguments::BeginWorldArguments begun = {};
  begun.image.colour = image_.address();
  begun.image.opacity = begun.image.colour + uint64_t{3} * pixels * sizeof(float);
  begun.image.depth = begun.image.opacity + uint64_t{pixels} * sizeof(float);
  begun.image.pixels = pixels;
  if (models_) {
    models_->draw(camera, worldFromCamera);
    begun.modelColours = models_->colours();
    begun.modelDepths = models_->depths();
  }
  stream_->run(begin_, std::as_bytes(std::span(&begun, 1)), groups);
  const std::vector<size_t> order = farthestFirst(worldFromCamera.translation);
  bool hasChanged = false;
  for (size_t place = 0; place < order.size(); ++place) {
    PlacedScene& scene = scenes_[order[place]];
    const bool wasFading = scene.renderer->isFading();
    if (!isSame || hasChanged || scene.drawn.colour == 0 || scene.renderer->hasMore()) {
      GpuSurroundings around = surroundingsAt(order, place);
      around.opaqueDepth = begun.image.depth;
      around.hasOpaqueDepthChanged = hasChanged;
      scene.drawn = scene.renderer->queueAmong(camera, worldFromCamera, std::move(around), exact);
    }
    const GpuRenderedView& drawn = scene.drawn;
    const arguments::AddSceneArguments added = {begun.image, drawn.colour, drawn.opacity, drawn.surface};
    stream_->run(addScene_, std::as_bytes(std::span(&added, 1)), groups);
    const TileCacheStatistics statistics = scene.renderer->state().cache;
    const uint64_t changes = statistics.loads + statistics.evictions;
    // Which of two contents that fade gives the surface changes without loading.
    hasChanged |= changes != scene.changes || wasFading || scene.renderer->isFading();
    scene.changes = changes;
  }
  last_ = {camera, worldFromCamera, exact};
}

RenderedView WorldRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  CHECK(opaqueDepth == nullptr);  // the models of the world are what is opaque
  queue(camera, worldFromCamera, true);
  RenderedView view = makeEmptyView(camera);
  size_t offset = 0;
  for (ImageF* image : {&view.colour, &view.opacity, &view.depth}) {
    const auto bytes = std::as_writable_bytes(std::span(image->pixels));
    stream_->download(image_, offset, bytes);
    offset += bytes.size();
  }
  for (size_t p = 0; p < view.depth.pixels.size(); ++p) {
    float& depth = view.depth.pixels[p];
    depth = std::isfinite(depth) ? depth * view.opacity.pixels[p] : 0;
  }
  return view;
}

GpuRenderedView WorldRenderer::draw(const Camera& camera, const Pose& worldFromCamera) {
  queue(camera, worldFromCamera, false);
  stream_->send();
  const uint64_t colour = image_.address();
  return {width_, height_, colour,
          colour + uint64_t{3} * static_cast<uint32_t>(width_) * static_cast<uint32_t>(height_) * sizeof(float)};
}

bool WorldRenderer::hasMore() const {
  return std::any_of(scenes_.begin(), scenes_.end(),
                     [](const PlacedScene& scene) { return scene.renderer->hasMore(); });
}

GpuViewRenderer::Pixel WorldRenderer::pixelAt(int x, int y) {
  const size_t pixels = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  const size_t pixel = static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  CHECK(pixel < pixels);
  float depth = 0;
  stream_->download(image_, (4 * pixels + pixel) * sizeof(float), std::as_writable_bytes(std::span(&depth, 1)));
  return std::isfinite(depth) ? Pixel{1, depth} : Pixel{};
}

SceneState WorldRenderer::state() const {
  SceneState sum;
  for (const PlacedScene& scene : scenes_) {
    const SceneState state = scene.renderer->state();
    sum.drawn += state.drawn;
    sum.missing += state.missing;
    sum.refused += state.refused;
    sum.budgetBytes += state.budgetBytes;
    sum.cache.bytes += state.cache.bytes;
    sum.cache.maxBytes += state.cache.maxBytes;
    sum.cache.loads += state.cache.loads;
    sum.cache.evictions += state.cache.evictions;
  }
  return sum;
}

}  // namespace tessera
