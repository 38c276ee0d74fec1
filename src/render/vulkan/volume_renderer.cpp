#include "render/vulkan/volume_renderer.h"

#include "shaders/begin_view.h"
#include "shaders/draw_volume.h"
#include "shaders/end_view.h"
#include "shaders/render/arguments_draw.h"

namespace tessera {

namespace {

constexpr uint32_t kPixelsOfGroup = 8;  // local_size of the kernels, along an edge
constexpr size_t kNumbersOfPixel = 5;   // view.glsl
constexpr size_t kNumbersDrawn = 5;     // colour, opacity, depth

TileSource<GpuVolumeContent> onCard(const std::shared_ptr<GpuStream>& stream, const TileSource<VolumeContent>& source) {
  TileSource<GpuVolumeContent> made;
  made.bytes = source.bytes;
  made.load = [stream, load = source.load](int tile) { return GpuVolumeContent(stream, load(tile)); };
  made.folder = source.folder;
  made.file = source.file;
  return made;
}

void copy(const Vec3d& from, float* to) {
  for (int a = 0; a < 3; ++a) to[a] = static_cast<float>(from[a]);
}

template <class Arguments>
void queue(GpuStream& stream, const GpuKernel& kernel, const Arguments& arguments, Groups groups) {
  stream.run(kernel, std::as_bytes(std::span(&arguments, 1)), groups);
}

}  // namespace

GpuVolumeRenderer::GpuVolumeRenderer(std::shared_ptr<const GpuContext> context, TileScene<VolumeContent> scene,
                                     const GpuRendererSettings& settings)
    : stream_(std::make_shared<GpuStream>(context)),
      tiles_(scene.frame, std::move(scene.tree), onCard(stream_, scene.source), settings.selection,
             settings.budgetBytes),
      settings_(settings),
      background_(scene.background[0], scene.background[1], scene.background[2]),
      begin_(context, kBeginViewSpirv),
      end_(context, kEndViewSpirv),
      pool_(0) {}

std::string GpuVolumeRenderer::device() const {
  return "vulkan " + stream_->context()->name();
}

const GpuKernel& GpuVolumeRenderer::drawKernel(uint32_t mostWidth) {
  const auto found = draw_.find(mostWidth);
  if (found != draw_.end()) return found->second;
  return draw_.try_emplace(mostWidth, stream_->context(), kDrawVolumeSpirv, std::span(&mostWidth, 1)).first->second;
}

void GpuVolumeRenderer::makePictures(const Camera& camera) {
  pixels_.update(camera, pool_);
  if (directions_ && camera == camera_) return;
  camera_ = camera;
  const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
  for (GpuBuffer* buffer : {&directions_, &opaqueDepth_, &state_, &drawn_}) stream_->retire(std::move(*buffer));
  directions_ = GpuBuffer(stream_->context(), pixels * 3 * sizeof(float));
  opaqueDepth_ = GpuBuffer(stream_->context(), pixels * sizeof(float));
  state_ = GpuBuffer(stream_->context(), pixels * kNumbersOfPixel * sizeof(float));
  drawn_ = GpuBuffer(stream_->context(), pixels * kNumbersDrawn * sizeof(float));
  std::vector<float> directions;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vec3f& direction = pixels_.at(x, y);
      directions.insert(directions.end(), direction.data(), direction.data() + 3);
    }
  }
  stream_->upload(directions_, 0, std::as_bytes(std::span(directions)));
}

RenderedView GpuVolumeRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  const TileFrame& frame = tiles_.frame();
  tiles_.loadFor(tileView(camera, worldFromCamera, frame));
  makePictures(camera);
  const size_t pixels = static_cast<size_t>(camera.width) * camera.height;

  arguments::DrawVolumeArguments draw = {};
  arguments::ViewArguments& view = draw.view;
  const Mat3d sceneFromCamera = frame.rotation.transpose() * worldFromCamera.rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      view.sceneFromCamera[3 * row + column] = static_cast<float>(sceneFromCamera(row, column));
    }
  }
  copy(frame.inScene(worldFromCamera.translation), view.origin);
  copy(frame.low, view.low);
  copy(frame.high, view.high);
  view.near = static_cast<float>(frame.near);
  view.scale = static_cast<float>(frame.scale);
  view.minTransmittance = settings_.minTransmittance;
  view.width = camera.width;
  view.height = camera.height;
  view.directions = directions_.address();
  if (opaqueDepth != nullptr) {
    CHECK(opaqueDepth->pixels.size() == pixels);
    stream_->upload(opaqueDepth_, 0, std::as_bytes(std::span(opaqueDepth->pixels)));
    view.opaqueDepth = opaqueDepth_.address();
  }
  view.pixels = state_.address();
  view.colour = drawn_.address();
  view.opacity = view.colour + 3 * pixels * sizeof(float);
  view.depth = view.opacity + pixels * sizeof(float);

  const Groups all = {(view.width + kPixelsOfGroup - 1) / kPixelsOfGroup,
                      (view.height + kPixelsOfGroup - 1) / kPixelsOfGroup};
  queue(*stream_, begin_, view, all);
  std::vector<DrawnContent<GpuVolumeContent>> contents = tiles_.frontToBack();
  const size_t ofCut = contents.size();
  if (const GpuVolumeContent* surround = tiles_.surround()) contents.emplace_back(surround);
  for (size_t i = 0; i < contents.size(); ++i) {
    const GpuVolumeContent::About& about = contents[i].content->about();
    copy(contents[i].low, draw.low);
    copy(contents[i].high, draw.high);
    draw.partCount = about.parts;
    draw.layerCount = about.layers;
    draw.featureRange = about.featureRange;
    draw.densityRange = about.densityRange;
    draw.stepsPerTexel = about.stepsPerTexel;
    draw.isSurround = i >= ofCut;
    draw.parts = about.partsAddress;
    draw.layers = about.layersAddress;
    draw.weights = about.weightsAddress;
    queue(*stream_, drawKernel(about.mostWidth), draw, all);
  }
  queue(*stream_, end_, view, all);

  RenderedView drawn{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                     ImageF(camera.width, camera.height, 1)};
  size_t offset = 0;
  for (ImageF* image : {&drawn.colour, &drawn.opacity, &drawn.depth}) {
    const auto bytes = std::as_writable_bytes(std::span(image->pixels));
    stream_->download(drawn_, offset, bytes);
    offset += bytes.size();
  }
  return drawn;
}

}  // namespace tessera
