// mesh_flight SCENE [STEPS]: a flight over a mesh scene on a GPU, as in a window: tiles are read in the background, and
// contents have a quarter of the memory of the finest level. Prints JSON: the largest memory of contents, of the
// drawer's own and of all that was allocated (counted at vkAllocateMemory), blank frames, and the levels drawn.
// mesh_flight STORED INFERRED: the same place with stored and with inferred maps: how similar the images are, and for
// each the bytes of the files that were read, memory, and the time until the image is complete.
// mesh_flight SCENE memory: with room for everything, the memory of contents, of all on the GPU, and of the process, at
// rest and in a flight; the area of the place, the number of texels of its finest level, and their size. See mesh.sh.
#include <fmt/format.h>
#include <volk.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string_view>

#include "base/error.h"
#include "base/memory.h"
#include "eval/psnr.h"
#include "gpu/context.h"
#include "gpu/heap.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_scene_renderer.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/vulkan/gpu_mesh_drawer.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWidth = 160, kHeight = 90;
constexpr int kViews = 5;
constexpr double kError = 0.25;  // pixels: more is requested than the budget holds
constexpr uint64_t kPoolBytes = uint64_t{64} << 20;

double secondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// Counts the memory that the process allocates from Vulkan.
class AllocationCount {
 public:
  // From now on; a device must be open, because opening one resets what is intercepted.
  static void begin() {
    allocate_ = std::exchange(vkAllocateMemory, &allocate);
    free_ = std::exchange(vkFreeMemory, &free);
  }
  static uint64_t most() { return most_; }

 private:
  static VkResult VKAPI_CALL allocate(VkDevice device, const VkMemoryAllocateInfo* what,
                                      const VkAllocationCallbacks* callbacks, VkDeviceMemory* memory) {
    const VkResult result = allocate_(device, what, callbacks, memory);
    const std::lock_guard lock(mutex_);
    if (result == VK_SUCCESS) {
      sizes_[*memory] = what->allocationSize;
      bytes_ += what->allocationSize;
      most_ = std::max<uint64_t>(most_, bytes_);
    }
    return result;
  }
  static void VKAPI_CALL free(VkDevice device, VkDeviceMemory memory, const VkAllocationCallbacks* callbacks) {
    free_(device, memory, callbacks);
    const std::lock_guard lock(mutex_);
    if (const auto size = sizes_.find(memory); size != sizes_.end()) {
      bytes_ -= size->second;
      sizes_.erase(size);
    }
  }

  static inline PFN_vkAllocateMemory allocate_ = nullptr;
  static inline PFN_vkFreeMemory free_ = nullptr;
  static inline std::mutex mutex_;
  static inline std::map<VkDeviceMemory, uint64_t> sizes_;
  static inline uint64_t bytes_ = 0, most_ = 0;
};

Pose lookAt(const Vec3d& eye, const Vec3d& target) {
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.translation = eye;
  return pose;
}

class Place {
 public:
  explicit Place(const fs::path& folder)
      : folder_(folder), tileset_(readTileset(folder)), frame_(makeTileFrame(tileset_)) {
    camera_.width = kWidth;
    camera_.height = kHeight;
    camera_.parameters = {0.8 * kWidth, 0.8 * kWidth, 0.5 * kWidth, 0.5 * kHeight};
  }

  // The same flight as in the browser's bench (web/bench/viewer.ts); `share`: 0 to 1.
  Pose along(double share) const {
    const double turn = 2 * std::numbers::pi * share, ahead = turn + 0.15;
    const double columns = 0.8 * tileset_.columns, rows = 0.8 * tileset_.rows;
    return lookAt(inWorld({columns * std::cos(turn), rows * std::sin(2 * turn), 0.5 + 0.4 * std::cos(3 * turn)}),
                  inWorld({columns * std::cos(ahead), rows * std::sin(2 * ahead), -0.3}));
  }
  const Camera& camera() const { return camera_; }
  TileScene open() const { return openTileScene(folder_, meshCodec()); }

  // Returns the bytes of the contents of a level in memory.
  uint64_t bytesOnGpu(uint32_t level) const {
    const TileScene scene = open();
    uint64_t bytes = 0;
    for (size_t tile = 0; tile < tileset_.tiles.size(); ++tile)
      if (tileset_.tiles[tile].level == level && scene.tree.tiles[tile].hasContent)
        bytes += scene.source.bytes(static_cast<int>(tile));
    return bytes;
  }
  double squareMetres() const { return (frame_.high - frame_.low).head<2>().prod() * frame_.scale * frame_.scale; }
  // Returns the number of texels in the contents of the finest level, and the smallest edge of one in metres.
  std::pair<uint64_t, double> texels() const {
    const TileScene scene = open();
    uint64_t texels = 0;
    double edge = INFINITY;
    for (size_t tile = 0; tile < tileset_.tiles.size(); ++tile) {
      if (tileset_.tiles[tile].level != 0 || !scene.tree.tiles[tile].hasContent) continue;
      edge = std::min(edge, tileset_.tiles[tile].geometricError);  // which is in metres
      const std::unique_ptr<Content> content = scene.source.load(static_cast<int>(tile));
      const auto* mesh = dynamic_cast<const ContentOf<MeshContent>*>(content.get());
      for (const PatchSet& part : mesh->value.parts) texels += part.featureBlocks[0].size() / PatchSet::kBc5Bytes * 16;
    }
    return {texels, edge};
  }
  // Adds the file of each content that is read, and once those of its resources, to `bytes`.
  TileScene openCounted(std::atomic<uint64_t>& bytes) const {
    TileScene scene = open();
    const auto load = scene.source.load;
    const auto used = std::make_shared<std::pair<std::mutex, std::set<int>>>();
    scene.source.load = [this, load, used, &bytes, source = scene.source](int tile) {
      bytes += fs::file_size(source.file(tile));
      const std::lock_guard lock(used->first);
      for (const int resource : source.tileResources(tile))
        if (used->second.insert(resource).second)
          bytes += fs::file_size(contentPath(folder_, tileset_.resources[static_cast<size_t>(resource)].uri));
      return load(tile);
    };
    return scene;
  }
  int contentLevel(int tile) const { return static_cast<int>(tileset_.tiles[static_cast<size_t>(tile)].level); }

 private:
  Vec3d inWorld(const Vec3d& x) const { return frame_.translation + frame_.scale * (frame_.rotation * x); }

  fs::path folder_;
  Tileset tileset_;
  TileFrame frame_;
  Camera camera_;
};

// Draws until nothing is missing and returns the seconds that this takes.
double drawUntilComplete(GpuSceneRenderer& gpu, const Place& place, const Pose& pose) {
  const auto begin = Clock::now();
  do {
    gpu.draw(place.camera(), pose);
    gpu.lastImage();
  } while (gpu.state().missing > 0);
  return secondsSince(begin);
}

bool isBlank(const RenderedView& image) {
  std::set<std::array<float, 3>> colours;
  for (size_t i = 0; i < image.colour.pixels.size() && colours.size() < 8; i += 3)
    colours.insert({image.colour.pixels[i], image.colour.pixels[i + 1], image.colour.pixels[i + 2]});
  return colours.size() < 8;
}

nlohmann::ordered_json fly(const Place& place, int steps) {
  const auto context = GpuContext::open();
  AllocationCount::begin();
  const auto stream = std::make_shared<GpuStream>(context);
  GpuRendererSettings settings;
  settings.budgetBytes = place.bytesOnGpu(0) / 4;
  settings.poolBytes = kPoolBytes;
  settings.inBackground = true;
  settings.draw.exact = false;
  settings.selection.maximumScreenSpaceError = kError;
  GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream), place.open(), settings);
  drawUntilComplete(gpu, place, place.along(0));
  // Images, staging buffers and what else does not depend on contents, and the pool.
  const uint64_t besides = context->heap().bytesInUse() - gpu.state().cache.bytes + kPoolBytes;
  std::map<int, uint64_t> drawn;
  int blank = 0, incomplete = 0;
  uint64_t inUse = 0;
  std::vector<double> seconds;
  for (int step = 0; step < steps; ++step) {
    const auto begin = Clock::now();
    gpu.draw(place.camera(), place.along(static_cast<double>(step) / steps));
    const RenderedView image = gpu.lastImage();
    seconds.push_back(secondsSince(begin));
    blank += isBlank(image);
    incomplete += gpu.state().missing > 0;
    inUse = std::max<uint64_t>(inUse, context->heap().bytesInUse());
    for (const SelectedTile& tile : gpu.cut().tiles)
      if (tile.visible) ++drawn[place.contentLevel(tile.content)];
  }
  std::sort(seconds.begin(), seconds.end());
  const SceneState state = gpu.state();
  nlohmann::ordered_json result = {{"device", context->name()},
                                   {"steps", steps},
                                   {"budget_bytes", state.budgetBytes},
                                   {"bytes_besides_contents", besides},
                                   {"most_bytes_of_contents", state.cache.maxBytes},
                                   {"most_bytes_in_use", inUse},
                                   {"most_bytes_allocated", AllocationCount::most()},
                                   {"loads", state.cache.loads},
                                   {"evictions", state.cache.evictions},
                                   {"blank_frames", blank},
                                   {"frames_with_coarser_contents", incomplete},
                                   {"median_seconds", seconds[seconds.size() / 2]},
                                   {"longest_seconds", seconds.back()}};
  for (const auto& [level, tiles] : drawn)
    result["tiles_of_a_frame"][fmt::format("level_{}", level)] = static_cast<double>(tiles) / steps;
  return result;
}

// Measures one scene in views from `place`, and returns their images.
std::vector<ImageF> measure(const Place& place, MeshInference inference, nlohmann::ordered_json& result) {
  const auto stream = std::make_shared<GpuStream>(GpuContext::open());
  GpuRendererSettings settings;
  settings.budgetBytes = uint64_t{4} << 30;
  settings.inBackground = true;
  settings.draw.exact = false;
  const size_t before = stream->context()->heap().bytesInUse();
  std::atomic<uint64_t> read = 0;
  GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream, {.inference = inference}), place.openCounted(read), settings);
  result["seconds_until_complete"] = drawUntilComplete(gpu, place, place.along(0));
  result["bytes_read"] = read.load();
  result["bytes_of_contents"] = gpu.state().cache.bytes;
  result["bytes_in_use"] = stream->context()->heap().bytesInUse() - before;
  std::vector<ImageF> images;
  for (int view = 0; view < kViews; ++view) {
    const Pose pose = place.along(static_cast<double>(view) / kViews);
    drawUntilComplete(gpu, place, pose);
    images.push_back(gpu.render(place.camera(), pose, nullptr).colour);
  }
  return images;
}

nlohmann::ordered_json compare(const Place& stored, const Place& inferred) {
  nlohmann::ordered_json result;
  const std::vector<ImageF> expected = measure(stored, MeshInference::cpu, result["stored"]);
  for (const auto& [name, inference] :
       {std::pair("inferred_on_the_cpu", MeshInference::cpu), std::pair("inferred_on_the_gpu", MeshInference::gpu)}) {
    const std::vector<ImageF> images = measure(inferred, inference, result[name]);
    double least = INFINITY;
    for (int view = 0; view < kViews; ++view)
      least = std::min<double>(least, psnr(images[static_cast<size_t>(view)], expected[static_cast<size_t>(view)]));
    result[name]["least_psnr"] = least;  // 99 if all are equal
  }
  return result;
}

nlohmann::ordered_json weigh(const Place& place) {
  const auto context = GpuContext::open();
  AllocationCount::begin();
  const auto stream = std::make_shared<GpuStream>(context);
  GpuRendererSettings settings;
  settings.budgetBytes = uint64_t{4} << 30;
  settings.poolBytes = kPoolBytes;
  settings.inBackground = true;
  settings.draw.exact = false;
  settings.selection.maximumScreenSpaceError = 0;  // the finest level everywhere
  const size_t before = context->heap().bytesInUse();
  const int64_t residentBefore = residentBytes();
  GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream), place.open(), settings);
  const auto described = [&] {
    return nlohmann::ordered_json{{"bytes_of_contents", gpu.state().cache.bytes},
                                  {"bytes_in_use", context->heap().bytesInUse() - before},
                                  {"most_bytes_allocated", AllocationCount::most()},
                                  {"resident_bytes_of_process", residentBytes() - residentBefore},
                                  {"most_resident_bytes_of_process", peakResidentBytes() - residentBefore}};
  };
  drawUntilComplete(gpu, place, place.along(0));
  nlohmann::ordered_json result = {{"device", context->name()}, {"square_metres", place.squareMetres()}};
  result["at_rest"] = described();
  constexpr int kSteps = 60;
  for (int step = 0; step < kSteps; ++step) {
    gpu.draw(place.camera(), place.along(static_cast<double>(step) / kSteps));
    gpu.lastImage();
  }
  result["after_a_flight"] = described();
  const auto [texels, edge] = place.texels();
  result["texels"] = texels;
  result["metres_of_texel"] = edge;
  return result;
}

int run(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fprintf(stderr, "usage: mesh_flight SCENE [STEPS | memory] or mesh_flight STORED INFERRED\n");
    return 2;
  }
  const bool hasSecond = argc == 3 && fs::exists(fs::path(argv[2]) / "tileset.json");
  const bool weighs = argc == 3 && std::string_view(argv[2]) == "memory";
  const int steps = argc == 3 && !hasSecond && !weighs ? std::atoi(argv[2]) : 600;
  if (steps < 1) {
    std::fprintf(stderr, "mesh_flight: %s is neither a scene nor a number of steps\n", argv[2]);
    return 2;
  }
  const nlohmann::ordered_json result = hasSecond ? compare(Place(argv[1]), Place(argv[2]))
                                        : weighs  ? weigh(Place(argv[1]))
                                                  : fly(Place(argv[1]), steps);
  std::printf("%s\n", result.dump(2).c_str());
  return 0;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  try {
    return tessera::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mesh_flight: %s\n", error.what());
    return 1;
  }
}
