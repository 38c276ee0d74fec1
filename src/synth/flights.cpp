#include "synth/flights.h"

#include <fmt/format.h>

#include <algorithm>
#include <numbers>

#include "base/check.h"
#include "base/random.h"

namespace tessera {
namespace {

constexpr double kPi = std::numbers::pi;

constexpr double kObliquePitch = 50 * kPi / 180;
constexpr double kSecondsBetweenSurveys = 600;  // to land, change the battery and take off

struct Flight {
  enum class Kind { nadir, oblique, orbit } kind;
  double altitude, heading;  // metres; radians
  double share;              // fraction of all photos
  int photos = 0;

  std::string name() const {
    switch (kind) {
      case Kind::nadir:
        return fmt::format("nadir {:.0f} m", altitude);
      case Kind::oblique:
        return fmt::format("oblique {:.0f} m heading {:.0f}", altitude, heading * 180 / kPi);
      case Kind::orbit:
        break;
    }
    return fmt::format("orbit {:.0f} m", altitude);
  }
};

struct Planner {
  const CityLayout& city;
  const Camera& camera;
  RandomStream random;
  std::vector<Station> stations;
  double clock = 0;
  int flightNumber = 0;

  double noise(double size) {
    const uint64_t i = 4 * stations.size() + draws++;
    return size * (2 * random.uniformDouble(i) - 1);
  }

  // Wind and a human hand: positions are off by a metre or so, attitudes by a degree or two.
  void shoot(double x, double y, double altitude, double heading, double pitch, const std::string& name) {
    draws = 1000 * (stations.size() + 1);
    x += noise(1.2);
    y += noise(1.2);
    double z = city.terrain(0, 0) + altitude + noise(1);
    z = std::max<double>(z, city.highestNear(static_cast<float>(x), static_cast<float>(y), 9) + 6);
    stations.push_back({{cameraRotation(heading + noise(0.035), pitch + noise(0.03), noise(0.02)), {x, y, z}},
                        clock,
                        name,
                        flightNumber});
    clock += 3;
  }
  uint64_t draws = 0;

  // Orbits the whole of a small city; in a large one, blocks spread over it.
  void orbit(const Flight& f) {
    const double half = 0.5 * std::max(city.area.width(), city.area.depth());
    const int circles = half < 130 ? 1 : std::max(1, f.photos / 14);
    const double radius = 0.62 * std::min(half, 100.0) + 0.45 * f.altitude;
    for (int i = 0; i < f.photos; ++i) {
      const int circle = static_cast<int>(static_cast<int64_t>(i) * circles / f.photos);
      const double turn = static_cast<double>(i) * circles / f.photos - circle;
      Vec2f middle(0, 0);
      if (circles > 1)
        middle = city.blocks[static_cast<size_t>((circle + 0.5) * city.blocks.size() / circles)].area.centre();
      const double angle = 2 * kPi * turn;
      shoot(middle.x() + radius * std::sin(angle), middle.y() + radius * std::cos(angle), f.altitude, angle + kPi,
            std::atan2(f.altitude - 8, radius), f.name());
    }
  }

  // Returns the extent along x and y of the places that a flight looks at. Photos at the edge look inwards for the most
  // part: what only one photo sees cannot be learnt from it.
  Vec2d spans(const Flight& f) const {
    const auto span = [&](double extent, double frame) {
      return std::max(extent - 0.5 * frame * f.altitude, 0.35 * extent);
    };
    return {span(city.area.width(), camera.width / camera.focalX()),
            span(city.area.depth(), camera.height / camera.focalY())};
  }

  // Flies lines with overlapping photos, to and fro. In a nadir survey the drone faces the direction of flight, and
  // lines run along the longer side of the city; in an oblique one, which looks ahead, it flies sideways.
  void survey(const Flight& f, double overlap) {
    const bool oblique = f.kind == Flight::Kind::oblique;
    const double pitch = oblique ? kObliquePitch : kPi / 2;
    const double distance = f.altitude / std::sin(pitch);
    const double right = distance * camera.width / camera.focalX() * (1 - overlap),
                 ahead = distance * camera.height / camera.focalY() / std::sin(pitch) * (1 - overlap);
    const Vec2d extent = spans(f);
    const double facing = oblique ? f.heading : extent.x() >= extent.y() ? kPi / 2 : 0;
    const Vec2d forward(std::sin(facing), std::cos(facing)), side(forward.y(), -forward.x());
    const Vec2d line = oblique ? side : forward, across = oblique ? forward : side;
    const auto intervals = [&](const Vec2d& axis, double step) {
      return static_cast<int>(std::ceil(extent.dot(axis.cwiseAbs()) / step));
    };
    const int columns = intervals(line, oblique ? right : ahead), rows = intervals(across, oblique ? ahead : right);
    for (int r = 0; r <= rows; ++r) {
      const bool back = r % 2 == 1;
      for (int k = 0; k <= columns; ++k) {
        const double along = (back ? columns - k : k) / std::max<double>(columns, 1) - 0.5,
                     beside = r / std::max<double>(rows, 1) - 0.5;
        const Vec2d at = extent.dot(line.cwiseAbs()) * along * line + extent.dot(across.cwiseAbs()) * beside * across -
                         (oblique ? f.altitude / std::tan(pitch) : 0) * forward;
        shoot(at.x(), at.y(), f.altitude, facing + (back && !oblique ? kPi : 0), pitch, f.name());
      }
    }
    clock += kSecondsBetweenSurveys;
  }

  // A serpentine path over the city, moved outwards so that the camera sees the city's edges.
  void fly(const Flight& f) {
    if (f.kind == Flight::Kind::orbit) return orbit(f);
    const bool oblique = f.kind == Flight::Kind::oblique;
    const double pitch = oblique ? kObliquePitch : kPi / 2;
    const double back = oblique ? f.altitude / std::tan(pitch) : 0;
    const double spanX = spans(f).x(), spanY = spans(f).y();
    const double ratio = (spanX / camera.width) / (spanY / camera.height);
    int columns = std::max(1, static_cast<int>(std::lround(std::sqrt(f.photos * ratio))));
    int rows = std::max(1, (f.photos + columns - 1) / columns);
    int done = 0;
    for (int r = 0; r < rows; ++r) {
      // The last photos are spread over the last row.
      const int inRow = (f.photos - done + (rows - r) - 1) / (rows - r);
      for (int k = 0; k < inRow; ++k, ++done) {
        const int c = r % 2 == 0 ? k : inRow - 1 - k;
        const double x = inRow > 1 ? spanX * (static_cast<double>(c) / (inRow - 1) - 0.5) : 0;
        const double y = rows > 1 ? spanY * (static_cast<double>(r) / (rows - 1) - 0.5) : 0;
        const double heading = oblique ? f.heading : (r % 2 == 0 ? kPi / 2 : -kPi / 2) * (spanX >= spanY ? 0 : 1);
        shoot(x - back * std::sin(heading), y - back * std::cos(heading), f.altitude, heading, pitch, f.name());
      }
    }
  }
};

std::vector<Flight> surveys(const FlightOptions& options) {
  std::vector<Flight> flights;
  for (const double altitude : options.altitudes) flights.push_back({Flight::Kind::nadir, altitude, 0, 0});
  const double highest = *std::max_element(options.altitudes.begin(), options.altitudes.end());
  for (int i = 0; i < 4; ++i) flights.push_back({Flight::Kind::oblique, highest, i * kPi / 2, 0});
  return flights;
}

std::vector<Flight> flightsOfPhotos(const FlightOptions& options) {
  std::vector<Flight> flights;
  for (double altitude : options.altitudes) {
    flights.push_back({Flight::Kind::nadir, altitude, 0, 0.30});
    for (int i = 0; i < 4; ++i) flights.push_back({Flight::Kind::oblique, altitude, i * kPi / 2, 0.1375});
    flights.push_back({Flight::Kind::orbit, altitude, 0, 0.15});
  }
  // The largest-remainder method makes the flights add up to the requested number of photos.
  const double scale = static_cast<double>(options.photos) / static_cast<double>(options.altitudes.size());
  double owed = 0;
  int given = 0;
  for (Flight& f : flights) {
    owed += f.share * scale;
    f.photos = static_cast<int>(std::lround(owed)) - given;
    given += f.photos;
  }
  flights.back().photos += options.photos - given;
  return flights;
}

}  // namespace

Mat3d cameraRotation(double heading, double pitch, double roll) {
  const Vec3d level(std::sin(heading), std::cos(heading), 0);
  const Vec3d forward = std::cos(pitch) * level - std::sin(pitch) * Vec3d(0, 0, 1);
  const Vec3d right(level.y(), -level.x(), 0);
  Mat3d rotation;
  rotation << right, forward.cross(right), forward;
  return rotation * Eigen::AngleAxisd(roll, Vec3d(0, 0, 1)).toRotationMatrix();
}

std::vector<Station> planFlights(const CityLayout& city, const Camera& camera, const FlightOptions& options) {
  CHECK((options.photos > 0) != (options.overlap > 0));
  CHECK(!options.altitudes.empty());
  Planner planner{city, camera, RandomStream(options.seed, 4), {}};
  for (const Flight& flight : options.overlap > 0 ? surveys(options) : flightsOfPhotos(options)) {
    if (options.overlap > 0) {
      planner.survey(flight, options.overlap);
    } else {
      planner.fly(flight);
    }
    ++planner.flightNumber;
  }
  return std::move(planner.stations);
}

Camera droneCamera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.lens = LensModel::openCv;
  const double f = 0.5 * width / std::tan(65 * kPi / 360);
  camera.parameters = {f, f, 0.5 * width + 0.004 * width, 0.5 * height - 0.003 * width, -0.018, 0.006, 0.0003, -0.0002};
  return camera;
}

}  // namespace tessera
