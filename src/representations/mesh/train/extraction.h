// Extraction of triangles (Gu et al. 2023, section 3.2): of all faces of the octahedra, only those are kept that rays
// see: of the training photos, and parallel rays from above.
#pragma once

#include <functional>

#include "representations/mesh/train/face_set.h"
#include "representations/mesh/train/mesh_model.h"
#include "scene/capture.h"
#include "train/image_rays.h"
#include "train/photo_tiles.h"

namespace tessera {

struct ExtractionSettings {
  float minOpacity = 0.3f;  // of a hit that keeps its face
  float maxOpacity = 0.8f;  // accumulated opacity beyond which a ray sees no further face
  int photoStride = 1;      // every photoStride-th pixel of a photo, along both axes
  double droppedShare = 0;  // of all contributions: the faces with the least are dropped
  // How often the faces that share an edge with the others, and whose middle has at least minOpacity, are added: they
  // close holes in views that differ from those of the rays.
  int dilation = 0;
  // Parallel rays: straight down, and from 8 directions each at 60°, 45° and 30° above the horizon; none with 0.
  double raysPerCell = 2;  // along an edge of a cell
};

// What looks at the rays of photos, and at parallel ones.
class RayFollower {
 public:
  explicit RayFollower(const Device& device) : maxRays_(ImageBatch::on(device).rays) {}
  virtual ~RayFollower() = default;
  uint32_t maxRays() const { return maxRays_; }  // at a time
  // Follows the first rays of at most maxRays(), as many as fit the buffers; returns their number, at least 1.
  // `weight`: of the rays' directions for the faces that they see.
  virtual uint32_t follow(const MeshRays& rays, float weight) = 0;

 protected:
  static constexpr uint32_t kMaxHits = 1024;  // of a ray
  uint32_t maxSamples() const { return kHitsPerRay * maxRays_; }

 private:
  static constexpr uint32_t kHitsPerRay = 32;  // on average, as long as all rays fit
  uint32_t maxRays_;
};

// Marks the faces that rays see.
class FaceMarker final : public RayFollower {
 public:
  // Keeps a reference to `model`.
  FaceMarker(MeshModel& model, uint32_t level, const ExtractionSettings& settings);

  uint32_t follow(const MeshRays& rays, float weight) override;
  const FaceSet& faces() const { return faces_; }

 private:
  MeshModel& model_;
  uint32_t level_;
  ExtractionSettings settings_;
  FaceSet faces_;
  MeshHits hits_;
  Array<uint32_t> counters_;
  Array<float> logits_;
};

// Follows the rays of the training photos, and parallel ones with distances that suit the cells of a level.
void followRays(MeshModel& model, uint32_t level, const Capture& capture, const std::vector<TileShares>* tiles,
                const ExtractionSettings& settings, RayFollower& follower,
                const std::function<void(int64_t done, int64_t all)>& onPhoto);

// Checks the faces of the finest level, if they are fixed (MeshModel::atlas), at the middles of the tiles.
SurfaceCoverage checkCoverage(MeshModel& model, const Capture& capture, const std::vector<TileShares>& tiles);

// Returns the faces of a level of a block that the training photos of `capture` and parallel rays see. `tiles`:
// [photo], the parts of the photos that are looked through; whole photos if it is null. Throws Error if a mask cannot
// be read.
FaceSet extractFaces(
    MeshModel& model, uint32_t level, const Capture& capture, const std::vector<TileShares>* tiles,
    const ExtractionSettings& settings,
    const std::function<void(int64_t done, int64_t all)>& onPhoto = [](int64_t, int64_t) {});

}  // namespace tessera
