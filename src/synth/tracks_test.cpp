#include "synth/tracks.h"

#include <gtest/gtest.h>

#include <map>

#include "synth/flights.h"

namespace tessera {
namespace {

Capture tracked(const CityScene& city, const Camera& camera, int threads, int perPhoto) {
  Capture capture;
  capture.cameras = {camera};
  for (const Station& s : planFlights(city.layout, camera, {24, {60, 110}, 2})) {
    Photo photo;
    photo.worldFromCamera = s.worldFromCamera;
    capture.photos.push_back(photo);
  }
  TrackOptions options;
  options.pointsPerPhoto = perPhoto;
  ThreadPool pool(threads);
  findTracks(city, LensTable(camera), options, pool, capture);
  return capture;
}

TEST(Tracks, AreNoisyAsAskedAndSeenByThreePhotosOrMore) {
  ThreadPool pool(2);
  const CityScene city(1, 1, 4, pool);
  const Camera camera = droneCamera(320, 240);
  const Capture capture = tracked(city, camera, 2, 40);
  ASSERT_GT(capture.points.size(), 300u);

  std::map<uint32_t, int> views;
  int close = 0, far = 0;
  uint32_t last = 0;
  for (const Observation& o : capture.observations) {
    ASSERT_LT(o.photo, capture.photos.size());
    ASSERT_LT(o.point, capture.points.size());
    EXPECT_GE(o.photo, last) << "sorted by photo";
    last = o.photo;
    ++views[o.point];
    EXPECT_TRUE(o.x >= 0 && o.y >= 0 && o.x < camera.width && o.y < camera.height);
    const Vec3d inCamera = capture.photos[o.photo].worldFromCamera.inverse() * capture.points[o.point].xInWorld;
    const double error = (*camera.pixelFromCamera(inCamera) - Vec2d(o.x, o.y)).norm();
    EXPECT_NEAR(error, o.error, 1e-3);
    (error < 2.5 ? close : far) += 1;
  }
  EXPECT_EQ(views.size(), capture.points.size());
  for (const auto& [point, count] : views) EXPECT_GE(count, 3);
  EXPECT_GT(far, 0) << "structure from motion errs";
  EXPECT_LT(far, 0.04 * close);

  // Points lie on surfaces, up to the noise.
  int off = 0;
  for (const SparsePoint& p : capture.points) {
    const Vec3f x = p.xInWorld.cast<float>();
    bool near = false;
    for (const Vec3f& d : {Vec3f(0, 0, 1), Vec3f(1, 0, 0), Vec3f(0, 1, 0)})
      near |= city.tracer->occluded({x - d * 0.8f, d, 0, 1.6f});
    off += near ? 0 : 1;
  }
  EXPECT_LT(off, 0.03 * static_cast<double>(capture.points.size()));
}

TEST(Tracks, DoNotDependOnThreads) {
  ThreadPool pool(2);
  const CityScene city(1, 1, 4, pool);
  const Camera camera = droneCamera(160, 120);
  const Capture a = tracked(city, camera, 1, 10), b = tracked(city, camera, 3, 10);
  ASSERT_EQ(a.points.size(), b.points.size());
  ASSERT_EQ(a.observations.size(), b.observations.size());
  for (size_t i = 0; i < a.points.size(); ++i) EXPECT_EQ(a.points[i].xInWorld, b.points[i].xInWorld);
  for (size_t i = 0; i < a.observations.size(); ++i) EXPECT_EQ(a.observations[i].x, b.observations[i].x);
}

}  // namespace
}  // namespace tessera
