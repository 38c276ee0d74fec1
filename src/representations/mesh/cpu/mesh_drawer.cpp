#include "representations/mesh/cpu/mesh_drawer.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/check.h"
#include "render/pixel_directions.h"
#include "representations/mesh/content/infer_maps.h"
#include "representations/mesh/cpu/mesh_tracer.h"

namespace tessera {
namespace {

// A content with what drawing needs beside it.
class PreparedMesh final : public Content {
 public:
  explicit PreparedMesh(std::unique_ptr<Content> decoded)
      : decoded_(std::move(decoded)), mesh_(contentAs<MeshContent>(*decoded_)), tracer_(makeTracer(mesh_)) {
    for (const PatchSet& part : mesh_.parts) decoders_.emplace_back(part.decoder, kMeshFeatures + kMeshHarmonics, 3);
  }

  uint64_t memoryBytes() const override {
    uint64_t bytes = decoded_->memoryBytes() + tracer_.memoryBytes();
    for (const DenseNetwork& decoder : decoders_) bytes += decoder.memoryBytes();
    return bytes;
  }
  std::optional<std::string> mismatchWith(const TileContent& declared) const override {
    return decoded_->mismatchWith(declared);
  }

  const MeshContent& mesh() const { return mesh_; }
  const MeshTracer& tracer() const { return tracer_; }
  const DenseNetwork& decoder(uint32_t part) const { return decoders_[part]; }

 private:
  static MeshTracer makeTracer(const MeshContent& mesh) {
    std::vector<PatchTriangles> parts;
    for (const PatchSet& part : mesh.parts) parts.push_back(makePatchTriangles(part));
    return MeshTracer(parts);
  }

  std::unique_ptr<Content> decoded_;
  const MeshContent& mesh_;
  MeshTracer tracer_;
  std::vector<DenseNetwork> decoders_;
};

struct PlacedMesh {
  const PreparedMesh* content;
  bool isUnlimited;
  Vec3d low, high;  // of the cells in which it is drawn
};

class MeshSceneShading final : public HitShading {
 public:
  explicit MeshSceneShading(const std::vector<PlacedMesh>& placed) : placed_(placed) {}

  MeshTexel texel(const MeshHit& hit) const override {
    const PatchSet& part = content(hit).mesh().parts[hit.part];
    const float last = static_cast<float>(part.patchEdge - 1);
    return mixTexels(part, hit.patch, hit.column * last, hit.row * last);
  }
  const DenseNetwork& decoder(const MeshHit& hit) const override { return content(hit).decoder(hit.part); }

 private:
  const PreparedMesh& content(const MeshHit& hit) const { return *placed_[hit.content].content; }

  const std::vector<PlacedMesh>& placed_;
};

class MeshDrawer final : public CpuDrawer {
 public:
  // A patch has at least 96 bytes when decoded, and two triangles. With the copies of their corners, Embree takes at
  // most three times as much for them (mesh_drawer_test.cpp).
  uint64_t residentBytes(uint64_t decodedBytes) const override { return 4 * decodedBytes + (1 << 20); }
  double hysteresis() const override { return kMeshHysteresis; }
  // While a content is prepared, its encoder is also in memory in float32.
  uint64_t residentBytesOfResource(uint64_t decodedBytes) const override { return 3 * decodedBytes; }
  std::unique_ptr<Content> prepare(std::unique_ptr<Content> content, int threads) const override {
    auto* decoded = dynamic_cast<ContentOf<MeshContent>*>(content.get());
    CHECK(decoded != nullptr);
    if (!decoded->value.encoders.empty()) {
      const std::lock_guard lock(inferring_);
      inferMapsOnCpu(decoded->value, threads);
    }
    return std::make_unique<PreparedMesh>(std::move(content));
  }

  RenderedView draw(const SceneView<Content>& view, const ViewRequest& request, const DrawSettings& settings,
                    ThreadPool& pool, DrawCounts& counts) override {
    std::vector<PlacedMesh> placed;
    for (const DrawnContent<Content>& drawn : view.frontToBack)
      placed.push_back({&prepared(*drawn.content), hasNoLimit(drawn), drawn.low, drawn.high});
    const bool hasBackground = view.backgroundBlock != nullptr;
    if (hasBackground) placed.push_back({&prepared(*view.backgroundBlock), true, Vec3d::Zero(), Vec3d::Zero()});
    directions_.update(request.camera, pool);
    return drawPlaced(placed, hasBackground, view.frame, request, settings.minTransmittance, pool, counts);
  }

 private:
  static bool hasNoLimit(const DrawnContent<Content>& drawn) {
    return !drawn.low.head<2>().array().isFinite().any() && !drawn.high.head<2>().array().isFinite().any();
  }
  static const PreparedMesh& prepared(const Content& content) {
    const auto* mesh = dynamic_cast<const PreparedMesh*>(&content);
    CHECK(mesh != nullptr);
    return *mesh;
  }

  RenderedView drawPlaced(const std::vector<PlacedMesh>& placed, bool hasBackground, const TileFrame& frame,
                          const ViewRequest& request, float minTransmittance, ThreadPool& pool,
                          DrawCounts& counts) const {
    const Camera& camera = request.camera;
    RenderedView image = makeEmptyView(camera);
    const Mat3d sceneFromCamera = frame.rotation.transpose() * request.worldFromCamera.rotation;
    const Vec3d origin = frame.inScene(request.worldFromCamera.translation);
    const MeshSceneShading shading(placed);
    std::vector<DrawCounts> countsOfRow(static_cast<size_t>(camera.height));
    pool.run(static_cast<size_t>(camera.height), [&](size_t row, int) {
      std::vector<MeshHit> hits;
      const int y = static_cast<int>(row);
      for (int x = 0; x < camera.width; ++x) {
        const Vec3d inCamera = directions_.at(x, y).cast<double>();
        if (inCamera.isZero()) continue;  // the lens model has no direction for this pixel: it stays empty
        const SceneRay along{origin, (sceneFromCamera * inCamera).normalized()};
        double far = TileFrame::kSceneEnd;
        bool endsAtModel = false;
        if (request.opaqueDepth != nullptr && inCamera.z() > 0) {
          const double end = *request.opaqueDepth->at(x, y) / (inCamera.z() * frame.scale);
          endsAtModel = end < far;
          far = std::min(far, end);
        }
        CompositedRay ray;
        size_t met = addBlocks(placed, hasBackground, frame, along, far, hits);
        compositeHits(hits, along.direction, minTransmittance, shading, ray);
        if (hasBackground) {
          const uint32_t number = static_cast<uint32_t>(placed.size() - 1);
          met += addBackground(placed.back(), number, frame, along, far, hits);
          compositeHits(hits, along.direction, minTransmittance, shading, ray);
          if (const MeshContent& mesh = placed.back().content->mesh(); mesh.skyEdge > 0 && !endsAtModel)
            addSky(mesh, along.direction, ray);
        }
        std::copy(ray.colour.begin(), ray.colour.end(), image.colour.at(x, y));
        *image.opacity.at(x, y) = 1 - ray.transmittance;
        *image.depth.at(x, y) = static_cast<float>(ray.depth * inCamera.z() * frame.scale);
        countsOfRow[row].steps += met;
        countsOfRow[row].samples += ray.samples;
      }
    });
    for (const DrawCounts& count : countsOfRow) {
      counts.steps += count.steps;
      counts.samples += count.samples;
    }
    return image;
  }

  // Replaces `hits` by those of a ray on the contents of tiles. Returns their number.
  static size_t addBlocks(const std::vector<PlacedMesh>& placed, bool hasBackground, const TileFrame& frame,
                          const SceneRay& ray, double far, std::vector<MeshHit>& hits) {
    hits.clear();
    for (uint32_t number = 0; number + (hasBackground ? 1 : 0) < placed.size(); ++number) {
      const PlacedMesh& at = placed[number];
      const size_t first = hits.size();
      at.content->tracer().addHits(ray.origin.cast<float>(), ray.direction.cast<float>(),
                                   static_cast<float>(frame.near), static_cast<float>(far), hits);
      for (size_t i = first; i < hits.size(); ++i) hits[i].content = number;
      if (at.isUnlimited) continue;
      const auto isBeside = [&](const MeshHit& hit) {
        const Vec3d x = ray.origin + double{hit.distance} * ray.direction;
        return x.x() < at.low.x() || x.x() >= at.high.x() || x.y() < at.low.y() || x.y() >= at.high.y();
      };
      hits.erase(std::remove_if(hits.begin() + static_cast<ptrdiff_t>(first), hits.end(), isBeside), hits.end());
    }
    return hits.size();
  }

  // Replaces `hits` by those on the background block, which are behind the scene's box.
  static size_t addBackground(const PlacedMesh& background, uint32_t number, const TileFrame& frame,
                              const SceneRay& ray, double far, std::vector<MeshHit>& hits) {
    hits.clear();
    const RayRange inside = clipToBox(ray, frame.low, frame.high, {frame.near, TileFrame::kSceneEnd});
    const double near = inside.empty() ? frame.near : inside.far;
    if (near < far) {
      background.content->tracer().addHits(ray.origin.cast<float>(), ray.direction.cast<float>(),
                                           static_cast<float>(near), static_cast<float>(far), hits);
    }
    for (MeshHit& hit : hits) hit.content = number;
    return hits.size();
  }

  static void addSky(const MeshContent& mesh, const Vec3d& direction, CompositedRay& ray) {
    const std::array<float, 3> sky = skyColour(mesh, direction);
    for (size_t c = 0; c < 3; ++c) ray.colour[c] += ray.transmittance * sky[c];
    if (ray.transmittance < 1) ray.depth /= 1 - ray.transmittance;
    ray.transmittance = 0;
  }

  PixelDirections directions_;
  mutable std::mutex inferring_;  // it uses all cores
};

}  // namespace

std::unique_ptr<CpuDrawer> makeMeshDrawer() {
  return std::make_unique<MeshDrawer>();
}

}  // namespace tessera
