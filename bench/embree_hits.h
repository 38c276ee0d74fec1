// All hits of rays on triangles by Embree, in order of distance. Embree returns the nearest hit of a ray only; a filter
// function, which it calls for every hit, records the hit and rejects it, so that the search continues. The hits of
// each ray are then sorted. Used by octahedra_embree.cpp.
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <cstdint>
#include <memory>
#include <vector>

#include "base/threads.h"

namespace tessera {

struct TriangleSet {
  std::vector<float> vertices;    // [vertices][3], shared by triangles
  std::vector<uint32_t> corners;  // [triangles][3]

  size_t triangles() const { return corners.size() / 3; }
};

// How Embree's bounding volume hierarchy is made. `low` and `refit` are for scenes that change: a new hierarchy of
// lower quality, or the old one with new bounds.
enum class HierarchyQuality { high, medium, low, refit };
const char* nameQuality(HierarchyQuality quality);

class EmbreeDevice {
 public:
  // Builds hierarchies with so many threads. Throws Error if there can be no device.
  explicit EmbreeDevice(int threads);
  RTCDevice get() const { return device_.get(); }
  // Throws Error if an earlier call failed.
  void requireNoError() const;

 private:
  std::shared_ptr<RTCDeviceTy> device_;
};

class EmbreeTriangles {
 public:
  // Keeps a reference to `device`. Throws Error if Embree fails.
  EmbreeTriangles(const EmbreeDevice& device, const TriangleSet& triangles, HierarchyQuality quality);
  // Replaces the positions of the vertices, and rebuilds or refits the hierarchy. Returns the seconds that the
  // hierarchy took. Throws Error if Embree fails.
  double moveVertices(const std::vector<float>& vertices);

  RTCScene scene() const { return scene_.get(); }

 private:
  const EmbreeDevice& device_;
  std::shared_ptr<RTCSceneTy> scene_;
  RTCGeometry geometry_ = nullptr;  // owned by the scene
};

// The cells in which hits count; positions are in units of cells.
struct CountedCells {
  uint32_t resolution = 0;
  const uint32_t* bits = nullptr;  // bit i + N (j + N k); null: every hit counts

  bool contains(float x, float y, float z) const {
    const uint32_t i = static_cast<uint32_t>(static_cast<int>(x)), j = static_cast<uint32_t>(static_cast<int>(y)),
                   k = static_cast<uint32_t>(static_cast<int>(z));
    if (i >= resolution || j >= resolution || k >= resolution) return false;
    const uint32_t cell = i + resolution * (j + resolution * k);
    return (bits[cell / 32] >> cell % 32 & 1) != 0;
  }
};

struct EmbreeRays {
  const float *origins, *directions;  // [rays][3], in units of cells
  uint32_t rays;
};

// The output of TraceOctahedra, with numbers of triangles instead of faces. Positions are multiplied by
// `positionScale`.
struct HitArrays {
  std::vector<uint32_t> firstHit;  // [rays + 1]
  std::vector<uint32_t> rayOfHit, triangles;
  std::vector<float> barycentrics, positions, distances;
  float positionScale = 1;

  HitArrays(uint32_t rays, size_t hits);
};

struct EmbreeQuery {
  uint32_t packet = 1;     // rays that are followed together: 1, 8 or 16
  bool coherent = false;   // what Embree is told of the rays of a packet
  CountedCells cells;      // hits elsewhere are dropped
  bool writesHits = true;  // else the sorted hits of a ray are only counted, in HitArrays::firstHit
};

class EmbreeTracer {
 public:
  explicit EmbreeTracer(int threads);
  ~EmbreeTracer();
  // Finds the hits of a batch. Fails a CHECK if they do not fit into `hits`.
  void trace(const EmbreeTriangles& triangles, const EmbreeQuery& query, const EmbreeRays& batch, HitArrays& hits);

 private:
  struct Hit;
  struct RayLists;
  struct Context;
  template <uint32_t kPacket>
  void traceTask(RTCScene scene, const EmbreeQuery& query, const EmbreeRays& batch, size_t task, RayLists& lists,
                 HitArrays& hits);
  static void recordHits(const RTCFilterFunctionNArguments* arguments);
  template <uint32_t kPacket>
  static void recordLanes(const RTCFilterFunctionNArguments* arguments);
  friend class EmbreeTriangles;

  ThreadPool pool_;
  std::vector<RayLists> listsOfThread_;
  std::vector<std::vector<Hit>> hitsOfTask_;
};

}  // namespace tessera
