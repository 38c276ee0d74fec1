// Scene units: the region of interest is the cube [-1,1]³ (for `volume`: half a block is 1), so that float kernels see
// small numbers.
#pragma once

#include "compute/rays.h"
#include "scene/capture.h"

namespace tessera {

struct SceneFrame {
  Vec3d centre = Vec3d::Zero();        // of the region of interest, in the world
  double scale = 1;                    // scene units per world unit
  Mat3d rotation = Mat3d::Identity();  // scene axes from the world's

  Vec3d sceneFromWorld(const Vec3d& x) const { return rotation * (x - centre) * scale; }
  Vec3d worldFromScene(const Vec3d& x) const { return rotation.transpose() * x / scale + centre; }
};

// The region of interest of a capture: a cube around what the cameras look at. With enough sparse points, their robust
// bounds (2nd to 98th percentile per axis); else the point nearest to all optical axes, reaching to the farthest
// camera, without those few that stand ten times as far out as most (warned of). `margin` enlarges it.
SceneFrame fitSceneFrame(const Capture& capture, double margin);

// A camera as ray kernels want it.
RayCamera makeRayCamera(const Camera& camera, const Pose& worldFromCamera, const SceneFrame& frame);

}  // namespace tessera
