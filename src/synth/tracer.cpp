#include "synth/tracer.h"

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "base/error.h"

namespace tessera {
namespace {

#if RTC_VERSION_MAJOR >= 4
void intersectOne(RTCScene scene, RTCRayHit& query) {
  rtcIntersect1(scene, &query);
}
void occludeOne(RTCScene scene, RTCRay& query) {
  rtcOccluded1(scene, &query);
}
#else
void intersectOne(RTCScene scene, RTCRayHit& query) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(scene, &context, &query);
}
void occludeOne(RTCScene scene, RTCRay& query) {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene, &context, &query);
}
#endif

constexpr unsigned kSolid = 0, kFoliage = 1;

// Returns whether a card has a leaf at (u, v). A card carries 4 × 4 leaves: ellipses, each shifted and turned by its
// own hash.
bool leafAt(float u, float v, uint32_t card) {
  constexpr int kCells = 4;
  const float x = u * kCells, y = v * kCells;
  const int ix = std::min(kCells - 1, static_cast<int>(x)), iy = std::min(kCells - 1, static_cast<int>(y));
  const uint32_t h = latticeHash(ix, iy, card * 2654435761u + 9u);
  const float angle = 6.2831853f * static_cast<float>(h & 255u) / 256;
  const float dx = x - (static_cast<float>(ix) + 0.4f + 0.2f * static_cast<float>((h >> 8) & 255u) / 256);
  const float dy = y - (static_cast<float>(iy) + 0.4f + 0.2f * static_cast<float>((h >> 16) & 255u) / 256);
  const float c = std::cos(angle), s = std::sin(angle);
  const float along = c * dx + s * dy, across = -s * dx + c * dy;
  return along * along / 0.24f + across * across / 0.10f < 1;
}

void cutOut(const RTCFilterFunctionNArguments* arguments) {
  for (unsigned i = 0; i < arguments->N; ++i) {
    if (arguments->valid[i] != -1) continue;
    const float u = RTCHitN_u(arguments->hit, arguments->N, i), v = RTCHitN_v(arguments->hit, arguments->N, i);
    if (!leafAt(u, v, RTCHitN_primID(arguments->hit, arguments->N, i))) arguments->valid[i] = 0;
  }
}

RTCRay embreeRay(const Ray& ray) {
  RTCRay r{};
  r.org_x = ray.origin.x();
  r.org_y = ray.origin.y();
  r.org_z = ray.origin.z();
  r.dir_x = ray.direction.x();
  r.dir_y = ray.direction.y();
  r.dir_z = ray.direction.z();
  r.tnear = ray.near;
  r.tfar = ray.far;
  r.mask = ~0u;
  return r;
}

}  // namespace

TraceDevice::TraceDevice() {
  // Embree builds with one thread, so that its tree, and thereby which of two coincident surfaces is hit, does not
  // depend on the machine's load.
  RTCDevice device = rtcNewDevice("threads=1");
  if (device == nullptr)
    throw Error("Embree", "", "the ray tracing device could not be made",
                "check that the installed Embree fits this CPU");
  device_ = {device, rtcReleaseDevice};
}

TraceScene::TraceScene(const TraceDevice& device, const SurfaceMesh& mesh)
    : mesh_(&mesh), scene_(rtcNewScene(device.get()), rtcReleaseScene) {
  rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
  if (!mesh.faces.empty()) {
    RTCGeometry solid = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(solid, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), mesh.positions.size()));
    for (const Vec3f& p : mesh.positions)
      for (int i = 0; i < 3; ++i) *points++ = p[i];
    auto* corners = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(solid, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                   3 * sizeof(uint32_t), mesh.faces.size()));
    for (const SurfaceFace& f : mesh.faces)
      for (uint32_t corner : {f.a, f.b, f.c}) *corners++ = corner;
    rtcCommitGeometry(solid);
    rtcAttachGeometryByID(scene_.get(), solid, kSolid);
    rtcReleaseGeometry(solid);
  }
  if (!mesh.leafObjects.empty()) {
    RTCGeometry leaves = rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_QUAD);
    auto* points = static_cast<float*>(rtcSetNewGeometryBuffer(leaves, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), mesh.leafCorners.size()));
    for (const Vec3f& p : mesh.leafCorners)
      for (int i = 0; i < 3; ++i) *points++ = p[i];
    auto* corners = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(leaves, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT4,
                                                                   4 * sizeof(uint32_t), mesh.leafObjects.size()));
    for (uint32_t i = 0; i < mesh.leafCorners.size(); ++i) *corners++ = i;
    rtcSetGeometryIntersectFilterFunction(leaves, cutOut);
    rtcSetGeometryOccludedFilterFunction(leaves, cutOut);
    rtcCommitGeometry(leaves);
    rtcAttachGeometryByID(scene_.get(), leaves, kFoliage);
    rtcReleaseGeometry(leaves);
  }
  rtcCommitScene(scene_.get());
  const RTCError error = rtcGetDeviceError(device.get());
  if (error != RTC_ERROR_NONE)
    throw Error("Embree", "", "the city could not be prepared for ray tracing, error " + std::to_string(error),
                "ask for fewer blocks, or free some memory");
}

std::optional<SurfaceHit> TraceScene::intersect(const Ray& ray) const {
  RTCRayHit query{};
  query.ray = embreeRay(ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  intersectOne(scene_.get(), query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

  SurfaceHit hit;
  hit.distance = query.ray.tfar;
  hit.position = ray.origin + ray.direction * hit.distance;
  hit.normal = Vec3f(query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z).normalized();
  hit.face = query.hit.primID;
  if (query.hit.geomID == kFoliage) {
    hit.material = Material::leaf;
    hit.object = &mesh_->objects[mesh_->leafObjects[query.hit.primID]];
    hit.textureAt = {query.hit.u, query.hit.v};
  } else {
    const SurfaceFace& face = mesh_->faces[query.hit.primID];
    hit.material = face.material;
    hit.object = &mesh_->objects[face.object];
    hit.textureAt = mesh_->textureAt[face.a] * (1 - query.hit.u - query.hit.v) +
                    mesh_->textureAt[face.b] * query.hit.u + mesh_->textureAt[face.c] * query.hit.v;
  }
  if (hit.normal.dot(ray.direction) > 0) {
    hit.normal = -hit.normal;
    hit.backFace = true;
  }
  return hit;
}

bool TraceScene::occluded(const Ray& ray) const {
  RTCRay query = embreeRay(ray);
  occludeOne(scene_.get(), query);
  return query.tfar < 0;
}

}  // namespace tessera
