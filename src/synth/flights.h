// Plans where a drone takes its photos: a given number in nadir grids, oblique passes and orbits at each altitude; or
// surveys, in lines whose photos overlap.
#pragma once

#include <string>
#include <vector>

#include "scene/camera.h"
#include "synth/layout.h"

namespace tessera {

struct FlightOptions {
  int photos = 0;                          // of all flights together; 0: as many as the overlap takes
  std::vector<double> altitudes{60, 120};  // above the ground at the middle of the city, metres
  uint64_t seed = 0;
  // Surveys, if above 0: the share of its extent on the ground in the middle of the picture that a photo has in common
  // with the next one of its line, and with those of the next line. A nadir survey is flown at each altitude, and four
  // oblique ones, which look north, east, south and west, at the highest.
  double overlap = 0;
};

struct Station {
  Pose worldFromCamera;
  double seconds = 0;  // since take-off
  std::string flight;  // "nadir 120 m", "oblique 60 m heading 90", "orbit 60 m"
  int flightNumber = 0;
};

// Returns the camera axes for a view along `heading` (radians from north, clockwise), `pitch` radians below the
// horizon.
Mat3d cameraRotation(double heading, double pitch, double roll = 0);

// Returns the stations in the order of flight. None is inside a building or close above a roof: there the drone climbs.
std::vector<Station> planFlights(const CityLayout& city, const Camera& camera, const FlightOptions& options);

// Returns a mildly distorted drone camera with a field of view of 65 degrees.
Camera droneCamera(int width, int height);

}  // namespace tessera
