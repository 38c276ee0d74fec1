#include "synth/city.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <GeographicLib/LocalCartesian.hpp>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "base/image_io.h"
#include "base/progress.h"
#include "base/random.h"
#include "scene/capture_writer.h"
#include "synth/exif.h"
#include "synth/flights.h"
#include "synth/photographer.h"
#include "synth/tracks.h"
#include "synth/xmp.h"

namespace tessera {
namespace {

// A fictitious location: the middle of the city is in a lake.
constexpr double kLatitude = 46.4531, kLongitude = 6.5412, kAltitude = 372;

void checkOptions(const CityOptions& o) {
  const auto refuse = [](const std::string& where, const std::string& why, const std::string& remedy) {
    throw Error("synthetic city", where, why, remedy);
  };
  if (o.blocksX < 1 || o.blocksY < 1 || o.blocksX > 100 || o.blocksY > 100)
    refuse("blocks", fmt::format("{}x{} blocks cannot be laid out", o.blocksX, o.blocksY), "ask for 1 to 100 each way");
  if (o.width < 8 || o.height < 8 || o.width > 16384 || o.height > 16384)
    refuse("size", fmt::format("photos cannot be {}x{}", o.width, o.height), "ask for 8 to 16384 pixels each way");
  if (o.photos < 0)
    refuse("photos", fmt::format("{} photos cannot be taken", o.photos), "ask for 1 or more, or 0 for enough");
  if (o.altitudes.empty()) refuse("altitudes", "no altitude is given", "give one or more, such as 60,120");
  for (double a : o.altitudes)
    if (!(a >= 20 && a <= 1000))
      refuse("altitudes", fmt::format("a drone cannot fly at {} m here", a), "give 20 to 1000 m");
  if (o.samplesPerPixel < 1) refuse("samples", "a pixel needs a sample", "ask for 1 or more");
  if (!(o.overlap >= 0 && o.overlap <= 0.95))
    refuse("overlap", fmt::format("photos cannot overlap by {:g} %", 100 * o.overlap), "ask for 1 to 95 %");
  if (o.overlap > 0 && o.photos > 0) refuse("overlap", "the number of photos follows from it", "ask for one of both");
  for (const double metres : {o.gpsNoise, o.gpsHeightNoise})
    if (!(metres >= 0 && metres <= 1000))
      refuse("GPS noise", fmt::format("{} m is not a sensible deviation", metres), "give 0 to 1000 m");
  for (const double metres : o.heightOffsets)
    if (!(std::abs(metres) <= 1000))
      refuse("height offsets", fmt::format("{} m is not a sensible error", metres), "give -1000 to 1000 m");
  if (!(o.exposureJitter >= 0 && o.exposureJitter <= 4))
    refuse("exposure jitter", fmt::format("{} is not a sensible deviation", o.exposureJitter), "give 0 to 4 stops");
}

// Identifies the options on which the bytes of the photos depend; marks a finished or unfinished city in its folder.
std::string fingerprint(const CityOptions& o, int photos) {
  return fmt::format(
      "{{\"synthesis\": 2, \"blocks\": \"{}x{}\", \"photos\": {}, \"size\": \"{}x{}\", \"seed\": {}, \"altitudes\": "
      "[{}], "
      "\"traffic\": {}, \"exposure_jitter\": {}, \"samples_per_pixel\": {}, \"pinhole\": {}, "
      "\"overlap\": {}, \"gps_noise\": [{}, {}], \"height_offsets\": [{}], \"exif\": {}}}\n",
      o.blocksX, o.blocksY, photos, o.width, o.height, o.seed, fmt::join(o.altitudes, ", "), o.traffic,
      o.exposureJitter, o.samplesPerPixel, o.pinhole, o.overlap, o.gpsNoise, o.gpsHeightNoise,
      fmt::join(o.heightOffsets, ", "), o.exif);
}

void claimFolder(const fs::path& out, const std::string& mark) {
  const fs::path file = out / "synth.json";
  if (fs::exists(file)) {
    if (readTextFile(file) != mark)
      throw Error(out.string(), "synth.json", "the folder holds a city made with other options",
                  "choose another folder, or remove this one");
    return;
  }
  if (fs::exists(out / "transforms.json"))
    throw Error(out.string(), "transforms.json", "the folder holds another capture", "choose another folder");
  writeFileAtomically(file, mark);
}

// Returns a normal deviate of a random stream.
double gaussian(const RandomStream& random, uint64_t i) {
  const double u = 1 - random.uniformDouble(2 * i), v = random.uniformDouble(2 * i + 1);
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
}

std::vector<double> exposuresFor(const CityOptions& o, int photos) {
  const RandomStream random(o.seed, 5);
  std::vector<double> gains(photos, 0.0);
  double mean = 0;
  for (int i = 0; i < photos; ++i) {
    gains[i] = o.exposureJitter * gaussian(random, i);
    mean += gains[i] / photos;
  }
  for (double& gain : gains) gain -= mean;
  return gains;
}

// A camera that changes its exposure does so by time and by ISO, in whole stops of the latter.
int isoStops(const CityOptions& o, int photo) {
  constexpr uint32_t kMaxStops = 2;
  return o.exposureJitter > 0 ? static_cast<int>(RandomStream(o.seed, 7).below(photo, kMaxStops + 1)) : 0;
}

// Returns what the drone's receiver and barometer say in a photo.
GpsFix gpsAt(const GeographicLib::LocalCartesian& earth, const CityOptions& o, const Station& station, int photo,
             double ground) {
  const RandomStream random(o.seed, 6);
  const auto flight = static_cast<size_t>(station.flightNumber);
  const double tooHigh = flight < o.heightOffsets.size() ? o.heightOffsets[flight] : 0;
  const auto noise = [&](double metres, int axis) {
    return metres > 0 ? metres * gaussian(random, 3 * static_cast<uint64_t>(photo) + axis) : 0;
  };
  const Vec3d at = station.worldFromCamera.translation;
  GpsFix fix;
  earth.Reverse(at.x() + noise(o.gpsNoise, 0), at.y() + noise(o.gpsNoise, 1),
                at.z() + noise(o.gpsHeightNoise, 2) + tooHigh, fix.latitude, fix.longitude, fix.altitude);
  // As drones do, it adds its height above take-off to that of the take-off to get the altitude.
  fix.relativeAltitude = at.z() - ground + noise(o.gpsHeightNoise, 2) + tooHigh;
  return fix;
}

// Writes the files of a photo. The JPEG comes last: its presence marks the photo as complete.
void writePhoto(const Photo& photo, const Exposed& exposed, const std::optional<ExifFields>& exif) {
  constexpr int kQuality = 96;
  writeDepthExr(photo.depth, exposed.depth);
  if (!photo.mask.empty()) writePng(photo.mask, exposed.mask);
  if (!exif) return writeJpeg(photo.image, exposed.colour, kQuality);
  writeFileAtomically(photo.image, withSegment(encodeJpeg(exposed.colour, kQuality, encodeExif(*exif)),
                                               encodeXmpSegment({exif->gps, photo.worldFromCamera.rotation})));
}

bool complete(const Photo& photo) {
  return fs::exists(photo.image) && fs::exists(photo.depth) && (photo.mask.empty() || fs::exists(photo.mask));
}

}  // namespace

int photosForCity(int blocksX, int blocksY) {
  return 16 + 14 * blocksX * blocksY;
}

Capture synthesiseCity(const fs::path& out, const CityOptions& options) {
  checkOptions(options);
  const int asked =
      options.photos > 0 || options.overlap > 0 ? options.photos : photosForCity(options.blocksX, options.blocksY);
  claimFolder(out, fingerprint(options, asked));

  ThreadPool pool(options.threads);
  const CityScene city(options.blocksX, options.blocksY, options.seed, pool);
  Camera camera = droneCamera(options.width, options.height);
  if (options.pinhole) {
    camera.lens = LensModel::pinhole;
    for (int i = 4; i < 8; ++i) camera.parameters[i] = 0;
  }
  const LensTable lens(camera);
  const std::vector<Station> stations =
      planFlights(city.layout, camera, {asked, options.altitudes, options.seed, options.overlap});
  const int count = static_cast<int>(stations.size());
  const std::vector<double> exposures = exposuresFor(options, count);
  const GeographicLib::LocalCartesian earth(kLatitude, kLongitude, kAltitude);
  const double ground = city.layout.terrain(0, 0);

  Capture capture;
  capture.root = out;
  capture.cameras = {camera};
  capture.geo = GeoFrame{kLatitude, kLongitude, kAltitude};
  const int digits = std::max<int>(4, static_cast<int>(fmt::formatted_size("{}", count - 1)));
  Progress progress("synth", count, "photos");
  for (int i = 0; i < count; ++i) {
    const std::string stem = fmt::format("photo_{:0{}}", i, digits);
    Photo photo;
    photo.name = "images/" + stem + ".jpg";
    photo.image = out / photo.name;
    photo.depth = out / "depths" / (stem + ".exr");
    if (options.traffic) photo.mask = out / "masks" / (stem + ".png");
    photo.worldFromCamera = stations[i].worldFromCamera;
    photo.split = options.holdoutEvery > 0 && i % options.holdoutEvery == 0 ? Split::test : Split::train;
    if (options.exposureJitter > 0) photo.exposure = exposures[i];
    const GpsFix fix = gpsAt(earth, options, stations[i], i, ground);
    std::optional<ExifFields> exif;
    if (options.exif) {
      photo.gps = fix;
      exif = {fix, 36 * camera.focalX() / camera.width, exposures[i], isoStops(options, i), stations[i].seconds};
    }
    if (!complete(photo)) {
      std::optional<TrafficScene> traffic;
      if (options.traffic) traffic.emplace(city, stations[i].seconds);
      const ShutterOptions shutter{options.samplesPerPixel, exposures[i], mix64(options.seed) + i};
      const Exposed exposed =
          takePhoto({city, traffic ? &*traffic : nullptr}, lens, photo.worldFromCamera, shutter, pool);
      writePhoto(photo, exposed, exif);
    }
    capture.photos.push_back(std::move(photo));
    progress.update(i + 1, stations[i].flight);
  }
  TrackOptions tracks;
  tracks.seed = options.seed;
  findTracks(city, lens, tracks, pool, capture);
  writeCapture(capture);
  progress.finish(fmt::format("{} points", capture.points.size()));
  return capture;
}

}  // namespace tessera
