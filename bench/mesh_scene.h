// Mesh scenes on the CPU, for programs that draw them in another way than the program does.
#pragma once

#include <memory>

#include "base/file.h"
#include "render/cpu/scene_renderer.h"
#include "render/tile_scene.h"

namespace tessera {

// Draws as the drawer of meshes does: derived classes change some of it.
class ChangedMeshDrawer : public CpuDrawer {
 public:
  ChangedMeshDrawer();
  uint64_t residentBytes(uint64_t decodedBytes) const override { return drawer_->residentBytes(decodedBytes); }
  uint64_t residentBytesOfResource(uint64_t decodedBytes) const override {
    return drawer_->residentBytesOfResource(decodedBytes);
  }
  std::unique_ptr<Content> prepare(std::unique_ptr<Content> content, int threads) const override {
    return drawer_->prepare(std::move(content), threads);
  }
  RenderedView draw(const SceneView<Content>& view, const ViewRequest& request, const DrawSettings& settings,
                    ThreadPool& pool, DrawCounts& counts) override {
    return drawer_->draw(view, request, settings, pool, counts);
  }

 private:
  std::unique_ptr<CpuDrawer> drawer_;
};

struct OpenedMeshScene {
  TileFrame frame;
  TileTree tree;
  std::unique_ptr<SceneRenderer> renderer;
};
// With a maximumScreenSpaceError of 0, all views show the finest level.
OpenedMeshScene openMeshScene(const fs::path& folder, std::unique_ptr<CpuDrawer> drawer,
                              double maximumScreenSpaceError = 0);

}  // namespace tessera
