// Where a drone takes its photos: nadir grids, oblique passes and orbits at each altitude.
#pragma once

#include <string>
#include <vector>

#include "scene/camera.h"
#include "synth/layout.h"

namespace tessera {

struct FlightOptions {
  int photos = 0;                          // of all flights together
  std::vector<double> altitudes{60, 120};  // above the ground at the middle of the city, metres
  uint64_t seed = 0;
};

struct Station {
  Pose worldFromCamera;
  double seconds = 0;  // since take-off
  std::string flight;  // "nadir 120 m", "oblique 60 m north", "orbit 60 m"
};

// Camera axes for a view along `heading` (radians from north, clockwise), `pitch` radians below the horizon.
Mat3d cameraRotation(double heading, double pitch, double roll = 0);

// In the order of flight. Never inside or close above a roof: there the drone climbs.
std::vector<Station> planFlights(const CityLayout& city, const Camera& camera, const FlightOptions& options);

// A mildly distorted drone lens, 65 degrees wide.
Camera droneCamera(int width, int height);

}  // namespace tessera
