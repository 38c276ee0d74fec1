#include "bench/embree_hits.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <limits>
#include <string>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include "base/check.h"
#include "base/error.h"

namespace tessera {
namespace {

constexpr size_t kRaysPerTask = 64;  // as TraceOctahedra on the CPU
constexpr uint32_t kMaxPacket = 16;
constexpr uint32_t kMaxHits = 1020;  // of a ray

#if RTC_VERSION_MAJOR >= 4
using ContextBase = RTCRayQueryContext;
#else
using ContextBase = RTCIntersectContext;
#endif

template <uint32_t kPacket>
struct RayPacket;
template <>
struct RayPacket<1> {
  using Rays = RTCRayHit;
};
template <>
struct RayPacket<8> {
  using Rays = RTCRayHit8;
};
template <>
struct RayPacket<16> {
  using Rays = RTCRayHit16;
};

template <uint32_t kPacket>
void intersect(RTCScene scene, ContextBase& context, [[maybe_unused]] bool coherent,
               typename RayPacket<kPacket>::Rays& rays, [[maybe_unused]] const int* valid) {
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  arguments.context = &context;
  if constexpr (kPacket == 1) rtcIntersect1(scene, &rays, &arguments);
  if constexpr (kPacket == 8) rtcIntersect8(valid, scene, &rays, &arguments);
  if constexpr (kPacket == 16) rtcIntersect16(valid, scene, &rays, &arguments);
#else
  if constexpr (kPacket == 1) rtcIntersect1(scene, &context, &rays);
  if constexpr (kPacket == 8) rtcIntersect8(valid, scene, &context, &rays);
  if constexpr (kPacket == 16) rtcIntersect16(valid, scene, &context, &rays);
#endif
}

void initialize(ContextBase& context, [[maybe_unused]] bool coherent) {
#if RTC_VERSION_MAJOR >= 4
  rtcInitRayQueryContext(&context);
#else
  rtcInitIntersectContext(&context);
  context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
#endif
}

// Treats denormal numbers as zero, as Embree recommends, while it exists.
class NoDenormals {
 public:
#if defined(__SSE__)
  NoDenormals() : before_(_mm_getcsr()) {
    _mm_setcsr(before_ | 0x8040);
  }
  ~NoDenormals() {
    _mm_setcsr(before_);
  }

 private:
  unsigned before_;
#endif
};

}  // namespace

const char* nameQuality(HierarchyQuality quality) {
  constexpr const char* kNames[] = {"high", "medium", "low", "refit"};
  return kNames[static_cast<int>(quality)];
}

EmbreeDevice::EmbreeDevice(int threads)
    : device_(rtcNewDevice(("threads=" + std::to_string(threads)).c_str()), [](RTCDevice device) {
        if (device != nullptr) rtcReleaseDevice(device);
      }) {
  if (device_ == nullptr)
    throw Error("Embree", "", "the ray tracing device could not be made",
                "check that the installed Embree fits this CPU");
}

void EmbreeDevice::requireNoError() const {
  const RTCError error = rtcGetDeviceError(device_.get());
  if (error != RTC_ERROR_NONE)
    throw Error("Embree", "", "failed with error " + std::to_string(error), "free some memory");
}

EmbreeTriangles::EmbreeTriangles(const EmbreeDevice& device, const TriangleSet& triangles, HierarchyQuality quality)
    : device_(device), scene_(rtcNewScene(device.get()), rtcReleaseScene) {
  const bool isDynamic = quality == HierarchyQuality::low || quality == HierarchyQuality::refit;
  rtcSetSceneFlags(scene_.get(), isDynamic ? RTC_SCENE_FLAG_DYNAMIC : RTC_SCENE_FLAG_NONE);
  // In a scene of low quality, each geometry has a hierarchy of its own quality.
  rtcSetSceneBuildQuality(scene_.get(), isDynamic                             ? RTC_BUILD_QUALITY_LOW
                                        : quality == HierarchyQuality::medium ? RTC_BUILD_QUALITY_MEDIUM
                                                                              : RTC_BUILD_QUALITY_HIGH);
  geometry_ = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
  if (isDynamic)
    rtcSetGeometryBuildQuality(geometry_,
                               quality == HierarchyQuality::low ? RTC_BUILD_QUALITY_LOW : RTC_BUILD_QUALITY_REFIT);
  void* const vertices = rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                 3 * sizeof(float), triangles.vertices.size() / 3);
  void* const corners = rtcSetNewGeometryBuffer(geometry_, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                3 * sizeof(uint32_t), triangles.triangles());
  device_.requireNoError();
  std::copy(triangles.vertices.begin(), triangles.vertices.end(), static_cast<float*>(vertices));
  std::copy(triangles.corners.begin(), triangles.corners.end(), static_cast<uint32_t*>(corners));
  rtcSetGeometryIntersectFilterFunction(geometry_, EmbreeTracer::recordHits);
  rtcCommitGeometry(geometry_);
  rtcAttachGeometry(scene_.get(), geometry_);
  rtcReleaseGeometry(geometry_);
  rtcCommitScene(scene_.get());
  device_.requireNoError();
}

double EmbreeTriangles::moveVertices(const std::vector<float>& vertices) {
  std::copy(vertices.begin(), vertices.end(),
            static_cast<float*>(rtcGetGeometryBufferData(geometry_, RTC_BUFFER_TYPE_VERTEX, 0)));
  const auto begin = std::chrono::steady_clock::now();
  rtcUpdateGeometryBuffer(geometry_, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcCommitGeometry(geometry_);
  rtcCommitScene(scene_.get());
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  device_.requireNoError();
  return seconds.count();
}

HitArrays::HitArrays(uint32_t rays, size_t hits)
    : firstHit(rays + size_t{1}),
      rayOfHit(hits),
      triangles(hits),
      barycentrics(2 * hits),
      positions(3 * hits),
      distances(hits) {}

struct EmbreeTracer::Hit {
  float distance;
  uint32_t triangle;
  float barycentrics[2];

  bool operator<(const Hit& other) const {
    return distance != other.distance ? distance < other.distance : triangle < other.triangle;
  }
};

// The hits of the rays of a packet. The distance between the lists of two rays is no power of two, so that they do not
// compete for the same lines of a cache.
struct EmbreeTracer::RayLists {
  uint32_t counts[kMaxPacket] = {};
  bool overflow = false;
  std::vector<Hit> hits = std::vector<Hit>(size_t{kMaxPacket} * (kMaxHits + 4));

  Hit* list(uint32_t lane) { return &hits[size_t{lane} * (kMaxHits + 4)]; }
  void add(uint32_t lane, const Hit& hit) {
    if (counts[lane] == kMaxHits) {
      overflow = true;
      return;
    }
    list(lane)[counts[lane]++] = hit;
  }
  // Sorts the hits of a ray, which arrive nearly in order, and returns their number. A hierarchy with spatial splits
  // reports some hits several times.
  uint32_t sort(uint32_t lane) {
    Hit* const all = list(lane);
    const uint32_t count = counts[lane];
    if (count > 64) {
      std::sort(all, all + count);
    } else {
      for (uint32_t i = 1; i < count; ++i) {
        const Hit hit = all[i];
        uint32_t place = i;
        for (; place > 0 && hit < all[place - 1]; --place) all[place] = all[place - 1];
        all[place] = hit;
      }
    }
    return static_cast<uint32_t>(
        std::unique(all, all + count, [](const Hit& a, const Hit& b) { return a.triangle == b.triangle; }) - all);
  }
};

struct EmbreeTracer::Context : ContextBase {
  RayLists* lists;
  CountedCells cells;
};

template <uint32_t kPacket>
void EmbreeTracer::recordLanes(const RTCFilterFunctionNArguments* arguments) {
  const Context& context = *static_cast<const Context*>(arguments->context);
  RTCRayN* const rays = arguments->ray;
  RTCHitN* const hits = arguments->hit;
  for (uint32_t lane = 0; lane < kPacket; ++lane) {
    if (arguments->valid[lane] != -1) continue;
    arguments->valid[lane] = 0;
    const float t = RTCRayN_tfar(rays, kPacket, lane);
    if (context.cells.bits != nullptr &&
        !context.cells.contains(RTCRayN_org_x(rays, kPacket, lane) + t * RTCRayN_dir_x(rays, kPacket, lane),
                                RTCRayN_org_y(rays, kPacket, lane) + t * RTCRayN_dir_y(rays, kPacket, lane),
                                RTCRayN_org_z(rays, kPacket, lane) + t * RTCRayN_dir_z(rays, kPacket, lane)))
      continue;
    context.lists->add(
        RTCRayN_id(rays, kPacket, lane),
        {t, RTCHitN_primID(hits, kPacket, lane), {RTCHitN_u(hits, kPacket, lane), RTCHitN_v(hits, kPacket, lane)}});
  }
}

void EmbreeTracer::recordHits(const RTCFilterFunctionNArguments* arguments) {
  switch (arguments->N) {
    case 1:
      return recordLanes<1>(arguments);
    case 8:
      return recordLanes<8>(arguments);
    default:
      CHECK(arguments->N == 16u);
      return recordLanes<16>(arguments);
  }
}

EmbreeTracer::EmbreeTracer(int threads) : pool_(threads), listsOfThread_(static_cast<size_t>(pool_.threads())) {}
EmbreeTracer::~EmbreeTracer() = default;

template <uint32_t kPacket>
void EmbreeTracer::traceTask(RTCScene scene, const EmbreeQuery& query, const EmbreeRays& batch, size_t task,
                             RayLists& lists, HitArrays& hits) {
  const NoDenormals noDenormals;
  Context context;
  initialize(context, query.coherent);
  context.lists = &lists;
  context.cells = query.cells;
  std::vector<Hit>& hitsOfTask = hitsOfTask_[task];
  hitsOfTask.clear();
  typename RayPacket<kPacket>::Rays packet;
  RTCRayN* const rays = RTCRayHitN_RayN(reinterpret_cast<RTCRayHitN*>(&packet), kPacket);
  RTCHitN* const hitFields = RTCRayHitN_HitN(reinterpret_cast<RTCRayHitN*>(&packet), kPacket);
  alignas(64) int valid[kMaxPacket];
  const uint32_t end = static_cast<uint32_t>(std::min<size_t>(batch.rays, (task + 1) * kRaysPerTask));
  for (uint32_t first = static_cast<uint32_t>(task * kRaysPerTask); first < end; first += kPacket) {
    const uint32_t count = std::min(kPacket, end - first);
    for (uint32_t lane = 0; lane < kPacket; ++lane) {
      const size_t ray = first + std::min(lane, count - 1);
      const float *const origin = batch.origins + 3 * ray, *const direction = batch.directions + 3 * ray;
      valid[lane] = lane < count ? -1 : 0;
      RTCRayN_org_x(rays, kPacket, lane) = origin[0];
      RTCRayN_org_y(rays, kPacket, lane) = origin[1];
      RTCRayN_org_z(rays, kPacket, lane) = origin[2];
      RTCRayN_dir_x(rays, kPacket, lane) = direction[0];
      RTCRayN_dir_y(rays, kPacket, lane) = direction[1];
      RTCRayN_dir_z(rays, kPacket, lane) = direction[2];
      RTCRayN_tnear(rays, kPacket, lane) = 0;
      RTCRayN_tfar(rays, kPacket, lane) = std::numeric_limits<float>::infinity();
      RTCRayN_time(rays, kPacket, lane) = 0;
      RTCRayN_mask(rays, kPacket, lane) = ~0u;
      RTCRayN_id(rays, kPacket, lane) = lane;
      RTCRayN_flags(rays, kPacket, lane) = 0;
      RTCHitN_geomID(hitFields, kPacket, lane) = RTC_INVALID_GEOMETRY_ID;
      lists.counts[lane] = 0;
    }
    intersect<kPacket>(scene, context, query.coherent, packet, valid);
    for (uint32_t lane = 0; lane < count; ++lane) {
      const uint32_t hitCount = lists.sort(lane);
      hits.firstHit[first + lane + size_t{1}] = hitCount;
      if (query.writesHits) hitsOfTask.insert(hitsOfTask.end(), lists.list(lane), lists.list(lane) + hitCount);
    }
  }
}

void EmbreeTracer::trace(const EmbreeTriangles& triangles, const EmbreeQuery& query, const EmbreeRays& batch,
                         HitArrays& hits) {
  CHECK(batch.rays < hits.firstHit.size());
  CHECK((query.packet == 1 || query.packet == 8 || query.packet == 16));
  const size_t tasks = (batch.rays + kRaysPerTask - 1) / kRaysPerTask;
  if (hitsOfTask_.size() < tasks) hitsOfTask_.resize(tasks);
  pool_.run(tasks, [&](size_t task, int thread) {
    RayLists& lists = listsOfThread_[static_cast<size_t>(thread)];
    if (query.packet == 1) return traceTask<1>(triangles.scene(), query, batch, task, lists, hits);
    if (query.packet == 8) return traceTask<8>(triangles.scene(), query, batch, task, lists, hits);
    traceTask<16>(triangles.scene(), query, batch, task, lists, hits);
  });
  for (const RayLists& lists : listsOfThread_) CHECK(!lists.overflow);
  if (!query.writesHits) return;
  hits.firstHit[0] = 0;
  for (uint32_t ray = 0; ray < batch.rays; ++ray) hits.firstHit[ray + size_t{1}] += hits.firstHit[ray];
  CHECK(hits.firstHit[batch.rays] <= hits.distances.size());
  pool_.run(tasks, [&](size_t task, int) {
    const Hit* hit = hitsOfTask_[task].data();
    for (size_t ray = task * kRaysPerTask; ray < std::min<size_t>(batch.rays, (task + 1) * kRaysPerTask); ++ray) {
      const float *const origin = batch.origins + 3 * ray, *const direction = batch.directions + 3 * ray;
      for (size_t row = hits.firstHit[ray]; row < hits.firstHit[ray + 1]; ++row, ++hit) {
        hits.rayOfHit[row] = static_cast<uint32_t>(ray);
        hits.triangles[row] = hit->triangle;
        std::copy_n(hit->barycentrics, 2, &hits.barycentrics[2 * row]);
        for (size_t axis = 0; axis < 3; ++axis)
          hits.positions[3 * row + axis] = (origin[axis] + hit->distance * direction[axis]) * hits.positionScale;
        hits.distances[row] = hit->distance;
      }
    }
  });
}

}  // namespace tessera
