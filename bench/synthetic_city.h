// The true surfaces of a capture of `tessera synth city`: the city is built again with the options that the capture
// records.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "base/file.h"
#include "base/threads.h"
#include "scene/camera.h"
#include "synth/city_scene.h"

namespace tessera {

// The names of the classes, in the order of SurfaceClass, and of what is no surface.
inline constexpr int kSky = kSurfaceClasses;
inline constexpr std::array<const char*, kSurfaceClasses + 1> kClassNames = {"ground", "facades", "roofs", "trees",
                                                                             "water",  "wires",   "cars",  "sky"};

// Throws Error if the folder holds no capture of a synthetic city.
std::unique_ptr<CityScene> rebuildCity(const fs::path& capture, ThreadPool& pool);

// Returns the ray through a place in the image; nothing if the lens has no direction there.
std::optional<Ray> rayThrough(const Camera& camera, const Pose& worldFromCamera, const Vec2d& pixel);

}  // namespace tessera
