// Renders a world of several scenes and models on the GPU, with the occlusion of the browser (web/src/scenes.ts): the
// models are drawn first. Then the farthest scene is blended over them, its rays ending at the models, and so on to the
// nearest scene, whose rays end at the models and at the surfaces of all scenes drawn before it. A surface is where
// half of what is behind is hidden. Opaque parts thus hide one another even where scenes interlock; where soft parts of
// several scenes overlap, they are blended in the order of the scenes.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "render/vulkan/gpu_scene_renderer.h"
#include "world/vulkan/model_pass.h"
#include "world/world_file.h"

namespace tessera {

// Moves a scene from the world of its capture to where it is placed.
TileFrame placeFrame(const TileFrame& frame, const Placement& placement);

class WorldRenderer final : public GpuViewRenderer {
 public:
  struct Scene {
    std::unique_ptr<GpuSceneRenderer> renderer;
    bool isMain = false;  // its background block is shown; of other scenes nothing outside their boxes
  };
  // The scenes and the models must use `stream`. `models`: null if there are none. Of `hidden`, boxes that hide nothing
  // now are ignored.
  WorldRenderer(std::shared_ptr<GpuStream> stream, std::vector<Scene> scenes, std::unique_ptr<ModelPass> models,
                const std::vector<HiddenBox>& hidden, const Eigen::Array3f& background);
  ~WorldRenderer() override;

  // The depth is that of the nearest surface. Throws Error if there are models and the camera is no pinhole.
  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth = nullptr) override;
  std::string whyNotThrough(const Camera& camera) const override;
  GpuRenderedView draw(const Camera& camera, const Pose& worldFromCamera) override;
  bool hasMore() const override;
  Pixel pixelAt(int x, int y) override;
  SceneState state() const override;  // sums over all scenes
  std::string device() const override { return "vulkan " + stream_->context()->name(); }
  Eigen::Array3f background() const override { return background_; }

 private:
  struct PlacedScene {
    std::unique_ptr<GpuSceneRenderer> renderer;
    bool isMain = false;
    uint64_t changes = 0;   // of its contents in memory, at the last image
    GpuRenderedView drawn;  // of the last image; it is shown again while nothing changes
  };
  void queue(const Camera& camera, const Pose& worldFromCamera, bool exact);
  void ensureCapacity(const Camera& camera);
  // Returns numbers of scenes.
  std::vector<size_t> farthestFirst(const Vec3d& eye) const;
  GpuSurroundings surroundingsAt(const std::vector<size_t>& farthestFirst, size_t place) const;

  std::shared_ptr<GpuStream> stream_;
  GpuKernel begin_, addScene_;
  std::vector<PlacedScene> scenes_;
  std::unique_ptr<ModelPass> models_;
  std::vector<Mat4d> boxesFromWorld_;
  Eigen::Array3f background_;
  GpuBuffer image_;  // [pixels][3] colours, [pixels] opacities, [pixels] depths
  int width_ = 0, height_ = 0;
  struct View {
    Camera camera;
    Pose worldFromCamera;
    bool exact = false;
  };
  std::optional<View> last_;  // the view of `image_`; nothing if that is not complete
};

}  // namespace tessera
