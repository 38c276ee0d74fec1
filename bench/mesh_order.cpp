// mesh_order SCENE CAPTURE: how well rasterisers can draw the patches of a mesh scene in the order in which its
// contents hold them. Prints JSON, for each level of detail and the background block:
//   acmr              vertices that a cache of 16 entries misses for each triangle, if corners at equal positions are
//   one
//                     vertex and a triangle's number gives its place in the textures
//   overdraw          fragments per covered pixel, of meshopt_analyzeOverdraw: along the axes, triangles with two sides
//   fragments         in the photos of CAPTURE, fragments per covered pixel that are not behind what is drawn before
//   them
//                     in the same content; those with an opacity below kFallbackAlphaCutoff hide nothing
//   front_to_back     the same if the patches were drawn from front to back for each pixel
// The maps of the scene must be stored.
#include <meshoptimizer.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "import/capture_reader.h"
#include "render/tile_scene.h"
#include "representations/mesh/bake/patch_order.h"
#include "representations/mesh/content/fallback_mesh.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_tracer.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint32_t kCacheSize = 16;
constexpr int kPixelStride = 2;  // along both axes

struct Sums {
  uint64_t triangles = 0, missed = 0, covered = 0, drawn = 0, pixels = 0, fragments = 0, sorted = 0;
};

// The triangles of a part in their order, with vertices in steps.
IndexedTriangles indexPart(const PatchSet& part) {
  std::vector<float> corners;
  for (uint32_t patch = 0; patch < part.patches; ++patch)
    for (const uint32_t number : patch < part.pairs ? std::vector{0u, 1u, 2u, 3u, 2u, 1u} : std::vector{0u, 1u, 2u})
      for (size_t axis = 0; axis < 3; ++axis)
        corners.push_back(part.vertices[size_t{12} * patch + size_t{3} * number + axis]);
  return indexTriangles(corners);
}

void analyseTriangles(const PatchSet& part, Sums& sums) {
  const IndexedTriangles triangles = indexPart(part);
  sums.triangles += part.triangles();
  sums.missed += meshopt_analyzeVertexCache(triangles.indices.data(), triangles.indices.size(), triangles.vertexCount(),
                                            kCacheSize, 0, 0)
                     .vertices_transformed;
  std::vector<uint32_t> twoSided;
  for (size_t first = 0; first < triangles.indices.size(); first += 3) {
    const uint32_t* const corner = triangles.indices.data() + first;
    twoSided.insert(twoSided.end(), {corner[0], corner[1], corner[2], corner[2], corner[1], corner[0]});
  }
  const meshopt_OverdrawStatistics overdraw = meshopt_analyzeOverdraw(
      twoSided.data(), twoSided.size(), triangles.vertices.data(), triangles.vertexCount(), 3 * sizeof(float));
  sums.covered += overdraw.pixels_covered;
  sums.drawn += overdraw.pixels_shaded;
}

class ContentViews {
 public:
  explicit ContentViews(const MeshContent& content) : content_(content), tracer_(makeTracer(content)) {}

  // Adds what a ray meets beyond `near`.
  void add(const SceneRay& ray, double near, Sums& sums) {
    hits_.clear();
    tracer_.addHits(ray.origin.cast<float>(), ray.direction.cast<float>(), static_cast<float>(near),
                    static_cast<float>(TileFrame::kSceneEnd), hits_);
    if (hits_.empty()) return;
    ++sums.pixels;
    std::sort(hits_.begin(), hits_.end(), [](const MeshHit& a, const MeshHit& b) {
      return a.part != b.part ? a.part < b.part : a.patch < b.patch;
    });
    sums.fragments += countFragments();
    std::sort(hits_.begin(), hits_.end(), [](const MeshHit& a, const MeshHit& b) { return a.distance < b.distance; });
    sums.sorted += countFragments();
  }

 private:
  static MeshTracer makeTracer(const MeshContent& content) {
    std::vector<PatchTriangles> triangles;
    for (const PatchSet& part : content.parts) triangles.push_back(makePatchTriangles(part));
    return MeshTracer(triangles);
  }
  uint64_t countFragments() const {
    uint64_t fragments = 0;
    float nearest = INFINITY;
    for (const MeshHit& hit : hits_) {
      if (hit.distance >= nearest) continue;
      ++fragments;
      const PatchSet& part = content_.parts[hit.part];
      const float last = static_cast<float>(part.patchEdge - 1);
      if (mixTexels(part, hit.patch, last * hit.column, last * hit.row).opacity >= kFallbackAlphaCutoff)
        nearest = hit.distance;
    }
    return fragments;
  }

  const MeshContent& content_;
  MeshTracer tracer_;
  std::vector<MeshHit> hits_;
};

void analyseViews(const MeshContent& content, const TileFrame& frame, const Mat4d& worldFromCapture,
                  const Capture& capture, Sums& sums) {
  ContentViews views(content);
  const Mat3d sceneFromCapture = frame.rotation.transpose() * worldFromCapture.topLeftCorner<3, 3>();
  for (const Photo& photo : capture.photos) {
    const Camera& camera = capture.cameras[photo.camera];
    const Pose& pose = photo.worldFromCamera;
    const Vec3d origin = frame.inScene((worldFromCapture * pose.translation.homogeneous()).head<3>());
    for (int y = 0; y < camera.height; y += kPixelStride)
      for (int x = 0; x < camera.width; x += kPixelStride)
        if (const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5}))
          views.add({origin, (sceneFromCapture * (pose.rotation * *inCamera)).normalized()}, frame.near, sums);
  }
}

Json analyse(const fs::path& folder, const fs::path& captureFolder) {
  const Capture capture = readCapture(captureFolder);
  const Tileset tileset = readTileset(folder);
  const TileFrame frame = makeTileFrame(tileset);
  // The place is the same, but the capture's world need not be.
  const Mat4d worldFromCapture = tileset.sourceFromWorld.inverse() * capture.sourceFromWorld;
  std::map<std::string, Sums> sumsOfLevel;
  for (const Tile& tile : tileset.tiles)
    for (const TileContent& listed : tile.contents) {
      if (!listed.resources.empty())
        throw Error(folder.string(), listed.uri, "its maps are inferred", "bake with --maps stored");
      const std::unique_ptr<Content> content = readContent(contentPath(folder, listed.uri), meshCodec());
      const MeshContent& mesh = contentAs<MeshContent>(*content);
      Sums& sums = sumsOfLevel[listed.backgroundBlock ? "background block" : "level " + std::to_string(tile.level)];
      for (const PatchSet& part : mesh.parts)
        if (part.patches > 0) analyseTriangles(part, sums);
      analyseViews(mesh, frame, worldFromCapture, capture, sums);
    }
  Json result;
  const auto divide = [](uint64_t a, uint64_t b) { return static_cast<double>(a) / static_cast<double>(b); };
  for (const auto& [level, sums] : sumsOfLevel) {
    if (sums.triangles == 0) continue;
    result[level] = {{"triangles", sums.triangles},
                     {"acmr", divide(sums.missed, sums.triangles)},
                     {"overdraw", divide(sums.drawn, sums.covered)},
                     {"fragments", divide(sums.fragments, sums.pixels)},
                     {"front_to_back", divide(sums.sorted, sums.pixels)}};
  }
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: mesh_order SCENE CAPTURE\n");
    return 2;
  }
  try {
    std::printf("%s\n", tessera::analyse(argv[1], argv[2]).dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_order: error: %s\n", error.what());
    return 1;
  }
}
