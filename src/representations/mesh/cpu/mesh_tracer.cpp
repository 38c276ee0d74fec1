#include "representations/mesh/cpu/mesh_tracer.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <atomic>
#include <cmath>
#include <string>
#include <tuple>

#include "base/error.h"
#include "scene/spherical_harmonics.h"

namespace tessera {
namespace {

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

struct Query {
  QueryContext context;                  // first, so that a pointer to it is one to the query
  const std::vector<uint32_t>* patches;  // of each part
  std::vector<MeshHit>* hits;
};

// Records a hit and rejects it, so that the ray goes on.
void recordHit(const RTCFilterFunctionNArguments* arguments) {
  const Query& query = *reinterpret_cast<const Query*>(arguments->context);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    arguments->valid[i] = 0;
    MeshHit hit;
    hit.part = RTCHitN_geomID(arguments->hit, arguments->N, i);
    const uint32_t triangle = RTCHitN_primID(arguments->hit, arguments->N, i), patches = (*query.patches)[hit.part];
    const float u = RTCHitN_u(arguments->hit, arguments->N, i), v = RTCHitN_v(arguments->hit, arguments->N, i);
    hit.distance = RTCRayN_tfar(arguments->ray, arguments->N, i);
    // The first triangles of all patches come first, then the second ones.
    const bool isSecond = triangle >= patches;
    hit.patch = isSecond ? triangle - patches : triangle;
    hit.column = isSecond ? 1 - u : u;
    hit.row = isSecond ? 1 - v : v;
    query.hits->push_back(hit);
  }
}

bool countMemory(void* counter, ssize_t bytes, bool) {
  *static_cast<std::atomic<int64_t>*>(counter) += bytes;
  return true;
}

RTCGeometry makeGeometry(RTCDevice device, const PatchTriangles& part) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), part.vertices.size() / 3));
  auto* corners = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(uint32_t), part.patches() + part.pairs));
  if (vertices == nullptr || corners == nullptr) return geometry;  // the device knows the error
  std::copy(part.vertices.begin(), part.vertices.end(), vertices);
  for (uint32_t patch = 0; patch < part.patches(); ++patch)
    for (const uint32_t corner : {0u, 1u, 2u}) *corners++ = 4 * patch + corner;
  for (uint32_t patch = 0; patch < part.pairs; ++patch)
    for (const uint32_t corner : {3u, 2u, 1u}) *corners++ = 4 * patch + corner;
  rtcSetGeometryIntersectFilterFunction(geometry, recordHit);
  rtcCommitGeometry(geometry);
  return geometry;
}

}  // namespace

PatchTriangles makePatchTriangles(const PatchSet& set) {
  PatchTriangles triangles;
  triangles.pairs = set.pairs;
  triangles.vertices.reserve(size_t{12} * set.patches);
  for (uint32_t patch = 0; patch < set.patches; ++patch)
    for (uint32_t number = 0; number < 4; ++number) {
      const Vec3d corner = set.corner(patch, number);
      for (int axis = 0; axis < 3; ++axis) triangles.vertices.push_back(static_cast<float>(corner[axis]));
    }
  return triangles;
}

struct MeshTracer::Embree {
  std::atomic<int64_t> bytes = 0;  // outlives the device
  std::vector<uint32_t> patches;
  std::unique_ptr<std::remove_pointer_t<RTCDevice>, decltype(&rtcReleaseDevice)> device{nullptr, rtcReleaseDevice};
  std::unique_ptr<std::remove_pointer_t<RTCScene>, decltype(&rtcReleaseScene)> scene{nullptr, rtcReleaseScene};
};

MeshTracer::MeshTracer(std::span<const PatchTriangles> parts) : embree_(std::make_unique<Embree>()) {
  embree_->device.reset(rtcNewDevice("threads=1"));
  RTCDevice device = embree_->device.get();
  if (device == nullptr) {
    throw Error("Embree", "", "the ray tracing device could not be made",
                "check that the installed Embree fits this CPU");
  }
  rtcSetDeviceMemoryMonitorFunction(device, countMemory, &embree_->bytes);
  embree_->scene.reset(rtcNewScene(device));
  rtcSetSceneFlags(embree_->scene.get(), RTC_SCENE_FLAG_ROBUST);
  for (uint32_t part = 0; part < parts.size(); ++part) {
    embree_->patches.push_back(parts[part].patches());
    if (parts[part].patches() == 0) continue;
    RTCGeometry geometry = makeGeometry(device, parts[part]);
    rtcAttachGeometryByID(embree_->scene.get(), geometry, part);
    rtcReleaseGeometry(geometry);
  }
  rtcCommitScene(embree_->scene.get());
  const RTCError error = rtcGetDeviceError(device);
  if (error != RTC_ERROR_NONE) {
    throw Error("Embree", "", "triangles could not be prepared for ray tracing, error " + std::to_string(error),
                "free some memory");
  }
}

MeshTracer::~MeshTracer() = default;
MeshTracer::MeshTracer(MeshTracer&&) noexcept = default;
MeshTracer& MeshTracer::operator=(MeshTracer&&) noexcept = default;

uint64_t MeshTracer::memoryBytes() const {
  return static_cast<uint64_t>(embree_->bytes.load());
}

void MeshTracer::addHits(const Vec3f& origin, const Vec3f& direction, float near, float far,
                         std::vector<MeshHit>& hits) const {
  Query query;
  query.patches = &embree_->patches;
  query.hits = &hits;
  RTCRayHit ray{};
  ray.ray.org_x = origin.x();
  ray.ray.org_y = origin.y();
  ray.ray.org_z = origin.z();
  ray.ray.dir_x = direction.x();
  ray.ray.dir_y = direction.y();
  ray.ray.dir_z = direction.z();
  ray.ray.tnear = near;
  ray.ray.tfar = far;
  ray.ray.mask = ~0u;
  ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  ray.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
#if RTC_VERSION_MAJOR >= 4
  rtcInitRayQueryContext(&query.context);
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &query.context;
  rtcIntersect1(embree_->scene.get(), &ray, &arguments);
#else
  rtcInitIntersectContext(&query.context);
  rtcIntersect1(embree_->scene.get(), &query.context, &ray);
#endif
}

void compositeHits(std::vector<MeshHit>& hits, const Vec3d& direction, float minTransmittance,
                   const HitShading& shading, CompositedRay& ray) {
  std::sort(hits.begin(), hits.end(), [](const MeshHit& a, const MeshHit& b) {
    return std::tie(a.distance, a.content, a.part, a.patch) < std::tie(b.distance, b.content, b.part, b.patch);
  });
  const std::array<float, 16> harmonics = evaluateHarmonics(direction);
  alignas(64) float values[DenseNetwork::kMaxWidth];
  for (const MeshHit& hit : hits) {
    if (ray.transmittance < minTransmittance) return;
    const MeshTexel texel = shading.texel(hit);
    if (texel.opacity <= 0) continue;
    const float weight = ray.transmittance * texel.opacity;
    std::copy(texel.features.begin(), texel.features.end(), values);
    std::copy_n(harmonics.begin(), kMeshHarmonics, values + kMeshFeatures);
    shading.decoder(hit).run(values);
    for (int c = 0; c < 3; ++c) ray.colour[c] += weight / (1 + std::exp(-values[c]));
    ray.depth += weight * hit.distance;
    ray.transmittance *= 1 - texel.opacity;
    ++ray.samples;
  }
}

}  // namespace tessera
