#include "representations/mesh/cpu/mesh_tracer.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <string>

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
  QueryContext context;  // first, so that a pointer to it is one to the query
  const MeshContent* content;
  std::vector<MeshTracer::Hit>* hits;
};

// Records a hit and rejects it, so that the ray goes on.
void recordHit(const RTCFilterFunctionNArguments* arguments) {
  const Query& query = *reinterpret_cast<const Query*>(arguments->context);
  const float edge = static_cast<float>(query.content->patchEdge - 1);
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    arguments->valid[i] = 0;
    const uint32_t triangle = RTCHitN_primID(arguments->hit, arguments->N, i);
    const float u = RTCHitN_u(arguments->hit, arguments->N, i), v = RTCHitN_v(arguments->hit, arguments->N, i);
    MeshTracer::Hit hit;
    hit.distance = RTCRayN_tfar(arguments->ray, arguments->N, i);
    hit.content = query.content;
    // The first triangles of all patches come first, then the second ones.
    const bool isSecond = triangle >= query.content->patches();
    hit.patch = isSecond ? triangle - query.content->patches() : triangle;
    hit.column = edge * (isSecond ? 1 - u : u);
    hit.row = edge * (isSecond ? 1 - v : v);
    query.hits->push_back(hit);
  }
}

}  // namespace

struct MeshTracer::Embree {
  const MeshContent* content;
  std::unique_ptr<std::remove_pointer_t<RTCDevice>, decltype(&rtcReleaseDevice)> device{nullptr, rtcReleaseDevice};
  std::unique_ptr<std::remove_pointer_t<RTCScene>, decltype(&rtcReleaseScene)> scene{nullptr, rtcReleaseScene};
};

MeshTracer::MeshTracer(const MeshContent& content) : embree_(std::make_unique<Embree>()) {
  embree_->content = &content;
  embree_->device.reset(rtcNewDevice("threads=1"));
  RTCDevice device = embree_->device.get();
  if (device == nullptr) {
    throw Error("Embree", "", "the ray tracing device could not be made",
                "check that the installed Embree fits this CPU");
  }
  embree_->scene.reset(rtcNewScene(device));
  rtcSetSceneFlags(embree_->scene.get(), RTC_SCENE_FLAG_ROBUST);
  if (content.patches() > 0) {
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                                 3 * sizeof(float), content.vertices.size() / 3));
    std::copy(content.vertices.begin(), content.vertices.end(), vertices);
    auto* corners = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(uint32_t), content.triangles()));
    for (uint32_t patch = 0; patch < content.patches(); ++patch)
      for (const uint32_t corner : {0u, 1u, 2u}) *corners++ = 4 * patch + corner;
    for (uint32_t patch = 0; patch < content.pairs; ++patch)
      for (const uint32_t corner : {3u, 2u, 1u}) *corners++ = 4 * patch + corner;
    rtcSetGeometryIntersectFilterFunction(geometry, recordHit);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(embree_->scene.get(), geometry);
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

void MeshTracer::addHits(const Vec3f& origin, const Vec3f& direction, float near, float far,
                         std::vector<Hit>& hits) const {
  Query query;
  query.content = embree_->content;
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

CompositedRay compositeHits(std::vector<MeshTracer::Hit>& hits, const Vec3f& direction, float minTransmittance) {
  std::sort(hits.begin(), hits.end(), [](const MeshTracer::Hit& a, const MeshTracer::Hit& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.patch < b.patch;
  });
  const std::array<float, 16> harmonics = evaluateHarmonics(direction.cast<double>().normalized());
  CompositedRay ray;
  float transmittance = 1;
  for (const MeshTracer::Hit& hit : hits) {
    const MeshTexel texel = mixTexels(*hit.content, hit.patch, hit.column, hit.row);
    if (texel.opacity <= 0) continue;
    const float weight = transmittance * texel.opacity;
    const std::array<float, 3> colour = decodeColour(hit.content->decoder, texel.features, harmonics);
    for (int c = 0; c < 3; ++c) ray.colour[c] += weight * colour[c];
    ray.depth += weight * hit.distance;
    transmittance *= 1 - texel.opacity;
    if (transmittance < minTransmittance) break;
  }
  ray.opacity = 1 - transmittance;
  return ray;
}

}  // namespace tessera
