// Which way photos look, and which of their pixels count.
#pragma once

#include <optional>

#include "base/image.h"
#include "scene/capture.h"
#include "train/scene_frame.h"

namespace tessera {

// Which way, in the scene, of unit length; nothing where the lens sees nothing.
std::optional<Vec3d> directionOf(const Vec2d& pixel, const Camera& camera, const Pose& pose, const SceneFrame& frame);
// How high a pixel looks: the sine of the angle with the scene's horizon; -1 where the lens sees nothing.
double riseOf(const Vec2d& pixel, const Camera& camera, const Pose& pose, const SceneFrame& frame);
// Of all pixels of all training photos.
double highestRise(const Capture& capture, const SceneFrame& frame);

// A photo's mask, of the photo's size; nothing where it has none. Throws Error when it cannot be read or has another
// size.
ImageU8 maskOf(const Photo& photo, const Camera& camera);

}  // namespace tessera
