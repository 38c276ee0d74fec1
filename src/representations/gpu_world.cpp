#include "representations/gpu_world.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "representations/codecs.h"
#include "representations/gpu_drawers.h"
#include "tiles/scene_folder.h"
#include "world/main_scene.h"
#include "world/placed_models.h"

namespace tessera {

std::unique_ptr<WorldRenderer> openGpuWorld(const std::shared_ptr<const GpuContext>& context, const World& world,
                                            const fs::path& worldFile, const GpuRendererSettings& settings) {
  const auto visible =
      std::count_if(world.scenes.begin(), world.scenes.end(), [](const WorldScene& scene) { return scene.isVisible; });
  if (visible == 0) {
    throw Error(worldFile.string(), "scenes", "are all invisible", "set \"visible\" of one to true");
  }
  GpuRendererSettings share = settings;
  share.budgetBytes = settings.budgetBytes / static_cast<uint64_t>(visible);
  share.poolBytes = settings.poolBytes / static_cast<uint64_t>(visible);
  const auto stream = std::make_shared<GpuStream>(context);
  std::vector<WorldRenderer::Scene> scenes;
  Eigen::Array3f background = Eigen::Array3f::Zero();
  const size_t main = findMainScene(world);
  for (size_t i = 0; i < world.scenes.size(); ++i) {
    const WorldScene& scene = world.scenes[i];
    const bool isMain = i == main;
    if (!scene.isVisible) continue;
    const fs::path folder = resolveScene(worldFile, scene, fmt::format("scenes[{}]", i));
    const Tileset tileset = readTileset(folder);
    TileScene opened = openTileScene(folder, requireCodec(folder, tileset));
    if (scene.placement) opened.frame = placeFrame(opened.frame, *scene.placement);
    if (!isMain) opened.tree.removeBackgroundBlocks();  // nothing outside their boxes is drawn
    scenes.push_back({std::make_unique<GpuSceneRenderer>(stream, makeGpuDrawer(tileset.representation, stream),
                                                         std::move(opened), share),
                      isMain});
    if (isMain || scenes.size() == 1) background = scenes.back().renderer->background();
  }
  PlacedModels models = readPlacedModels(world, worldFile);
  auto pass = models.placed.empty() ? nullptr : std::make_unique<ModelPass>(stream, models.models, models.placed);
  return std::make_unique<WorldRenderer>(stream, std::move(scenes), std::move(pass), world.hidden, background);
}

}  // namespace tessera
