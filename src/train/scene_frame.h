// Scene units, in which the region of interest is the cube [-1,1]³ (for models in blocks: half the edge of a block is
// 1), so that kernels in float work with small numbers.
#pragma once

#include "compute/rays.h"
#include "scene/capture.h"

namespace tessera {

struct SceneFrame {
  Vec3d centre = Vec3d::Zero();        // of the region of interest, in the world
  double scale = 1;                    // scene units per world unit
  Mat3d rotation = Mat3d::Identity();  // from world to scene axes

  Vec3d sceneFromWorld(const Vec3d& x) const { return rotation * (x - centre) * scale; }
  Vec3d worldFromScene(const Vec3d& x) const { return rotation.transpose() * x / scale + centre; }
};

// Fits the region of interest of a capture, a cube around what the cameras look at. With enough sparse points it covers
// their robust bounds (2nd to 98th percentile per axis). Otherwise it is centred at the point nearest to all optical
// axes and reaches to the farthest camera, ignoring cameras that are more than ten times as far out as nine in ten, of
// which it warns. `margin` is a factor that enlarges the cube.
SceneFrame fitSceneFrame(const Capture& capture, double margin);

// Returns a camera in scene units, in the form that the ray kernels take.
RayCamera makeRayCamera(const Camera& camera, const Pose& worldFromCamera, const SceneFrame& frame);

}  // namespace tessera
