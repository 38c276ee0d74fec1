#include <fmt/format.h>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "synth/city.h"

namespace tessera {
namespace {

// Parses a pair such as "4x3", both numbers at least 1.
void parsePair(const std::string& text, const char* flag, int* first, int* second) {
  int used = 0;
  if (std::sscanf(text.c_str(), "%dx%d%n", first, second, &used) != 2 || used != static_cast<int>(text.size()) ||
      *first < 1 || *second < 1) {
    throw CLI::ValidationError(flag, "'" + text + "' is not of the form 4x3");
  }
}

struct SynthFlags {
  std::string out, blocks = "2x2", size = "400x300";
  double overlap = 0;
  std::vector<double> gpsNoise;
  bool noExif = false;
  CityOptions city;
};

}  // namespace

void addSynthVerb(CLI::App& app) {
  CLI::App* synth = app.add_subcommand("synth", "make a capture of a place that does not exist");
  synth->require_subcommand(1);
  CLI::App* verb = synth->add_subcommand("city", "a procedural city, ray traced, with everything known exactly");
  verb->footer("Example:\n  tessera synth city city.capture --blocks 2x2 --photos 60");
  auto flags = std::make_shared<SynthFlags>();
  verb->add_option("out", flags->out, "capture folder to write")->required();
  verb->add_option("--blocks", flags->blocks, "city blocks, east x north")->capture_default_str();
  CLI::Option* photos =
      verb->add_option("--photos", flags->city.photos, "number of photos; 0: enough for the size of the city")
          ->capture_default_str();
  verb->add_option("--overlap", flags->overlap,
                   "surveys whose photos overlap by this percentage along and across the lines: a nadir survey at each "
                   "altitude, four oblique ones at the highest; the number of photos follows")
      ->check(CLI::Range(1, 95))
      ->excludes(photos);
  verb->add_option("--size", flags->size, "photo size in pixels")->capture_default_str();
  verb->add_option("--seed", flags->city.seed, "seed; each value gives another city")->capture_default_str();
  verb->add_option("--altitudes", flags->city.altitudes, "altitudes of the flights, metres above ground")
      ->delimiter(',')
      ->capture_default_str();
  verb->add_flag("--traffic", flags->city.traffic, "cars that move between photos, with masks");
  verb->add_option("--exposure-jitter", flags->city.exposureJitter, "spread of the photos' exposure, in stops")
      ->capture_default_str();
  verb->add_option("--gps-noise", flags->gpsNoise, "standard deviations of GPS in metres: each horizontal axis, height")
      ->delimiter(',')
      ->expected(2);
  verb->add_option("--height-offsets", flags->city.heightOffsets,
                   "metres by which the GPS heights of the first, second, ... flight are too high")
      ->delimiter(',');
  verb->add_flag("--no-exif", flags->noExif, "photos without EXIF and XMP");
  verb->add_option("--samples", flags->city.samplesPerPixel, "rays per pixel")->capture_default_str();
  verb->add_flag("--pinhole", flags->city.pinhole, "an ideal lens instead of a mildly distorted one");
  verb->add_option("--threads", flags->city.threads, "CPU threads; 0: all cores")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
  verb->callback([flags] {
    parsePair(flags->blocks, "--blocks", &flags->city.blocksX, &flags->city.blocksY);
    parsePair(flags->size, "--size", &flags->city.width, &flags->city.height);
    flags->city.overlap = flags->overlap / 100;
    if (!flags->gpsNoise.empty()) {
      flags->city.gpsNoise = flags->gpsNoise[0];
      flags->city.gpsHeightNoise = flags->gpsNoise[1];
    }
    flags->city.exif = !flags->noExif;
    const Capture capture = synthesiseCity(flags->out, flags->city);
    fmt::print("{}: {} photos, {} sparse points\n", flags->out, capture.photos.size(), capture.points.size());
  });
}

}  // namespace tessera
