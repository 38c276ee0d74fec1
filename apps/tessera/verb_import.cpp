#include <fmt/format.h>

#include "apps/tessera/verbs.h"
#include "import/importer.h"

namespace tessera {

void addImportVerb(CLI::App& app) {
  struct Flags {
    std::string source, out;
    ImportOptions options;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb =
      app.add_subcommand("import", "photographs with poses (COLMAP, nerfstudio, instant-ngp, Blender) to a capture");
  verb->footer("Example:\n  tessera import flight/ flight.capture --downscale 4");
  verb->add_option("source", flags->source, "folder with photos and poses")->required();
  verb->add_option("out", flags->out, "capture folder to write")->required();
  verb->add_option("--downscale", flags->options.downscale, "divides width and height")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
  verb->add_option(
          "--holdout", flags->options.holdout,
          "photos held out for evaluation: every:N, list:FILE, none, or auto (the source's own split, else every:8)")
      ->capture_default_str();
  verb->add_option(
          "--mask-command", flags->options.maskCommand,
          "program that writes the mask of a photo, black where it is to be ignored: 'segment.py {photo} {mask}'")
      ->check([](const std::string& command) { return std::string(command.empty() ? "names no program" : ""); });
  verb->add_option("--threads", flags->options.threads, "CPU threads; 0: all cores")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
  verb->callback([flags] {
    const Capture capture = importCapture(flags->source, flags->out, flags->options);
    fmt::print("{}: {} photos ({} to train on, {} held out), {} sparse points{}\n", flags->out, capture.photos.size(),
               capture.photosIn(Split::train).size(), capture.photosIn(Split::test).size(), capture.points.size(),
               capture.geo ? ", georeferenced" : "");
  });
}

}  // namespace tessera
