#include <fmt/format.h>

#include <cmath>
#include <cstdio>

#include "apps/tessera/render_source.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "eval/report.h"
#include "import/capture_reader.h"

namespace tessera {
namespace {

constexpr const char* kNoResponse =
    "it was trained without exposures, EXIF states too few of them, or it does not explain how its photos differ";

}  // namespace

void addEvalVerb(CLI::App& app) {
  struct Flags {
    std::string model, capture, split = "test", exposure = "neutral", json, report, images, lpips;
    DeviceOptions device;
    int level = 0;
    bool rightHalves = false;
    double memoryMiB = 0;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("eval", "held-out photos against renderings: PSNR, SSIM, LPIPS, depth error");
  verb->footer("Example:\n  tessera eval fox.model fox.capture --report fox.html --json fox.json");
  verb->add_option("model", flags->model, "model or scene folder")->required();
  verb->add_option("capture", flags->capture, "capture folder")->required();
  verb->add_option("--split", flags->split, "which photos")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "validation", "train"}));
  verb->add_option(
          "--exposure", flags->exposure,
          "neutral, predicted from EXIF, auto: predicted if the model can and else neutral, or fitted on the left "
          "half and evaluated on the right")
      ->capture_default_str()
      ->check(CLI::IsMember({"neutral", "predicted", "auto", "fitted"}));
  verb->add_flag("--right-halves", flags->rightHalves,
                 "evaluate colour on the right half of each view, to compare with fitted exposures");
  verb->add_option("--json", flags->json, "write the result as one JSON object here; - prints it");
  verb->add_option("--report", flags->report, "write a self-contained report.html here; default MODEL/report.html");
  verb->add_option("--images", flags->images, "write each rendering and its error map as PNG into this folder");
  verb->add_option("--lpips", flags->lpips, "LPIPS weights (safetensors)");
  verb->add_option("--lod", flags->level, "scenes only: the finest level of detail to render")
      ->capture_default_str()
      ->check(CLI::Range(0, 64));
  verb->add_option("--memory-mib", flags->memoryMiB,
                   "scenes only: memory for the contents; 0: half of the machine's, or of a GPU's own")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e9));
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    const Capture capture = readCapture(flags->capture);
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const RenderSourceOptions sourceOptions{flags->device.threads, flags->level, flags->memoryMiB};
    requireSceneFor(sourceOptions, flags->model);
    const std::unique_ptr<RenderSource> renderSource = openRenderSource(*device, flags->model, sourceOptions);
    EvaluateOptions options;
    options.split = *splitFromName(flags->split);
    renderSource->requireMatchingWorld(capture);
    if (const auto known = renderSource->trainedOnAmong(capture, options.split);
        options.split != Split::train && !known.empty()) {
      warn("{} of the views were trained on ('{}' first): the numbers flatter the model", known.size(), known.front());
    }
    const bool choosesExposures = flags->exposure == "auto";
    options.exposures = choosesExposures ? Exposures::predicted : *exposuresFromName(flags->exposure);
    options.rightHalves = flags->rightHalves;
    if (options.exposures == Exposures::predicted) {
      options.response = renderSource->exposureResponse();
      if (!options.response && choosesExposures) {
        options.exposures = Exposures::neutral;
        inform("exposures: neutral, as {}", kNoResponse);
      } else if (!options.response) {
        throw Error(flags->model, "--exposure predicted",
                    std::string("does not tell how colours follow exposures: ") + kNoResponse, "use neutral or fitted");
      }
    }
    options.lpipsWeights = flags->lpips;
    options.imagesDir = flags->images;
    options.threads = flags->device.threads;
    const size_t views = capture.photosIn(options.split).size();
    const auto name = [](const std::string& folder) { return fs::weakly_canonical(folder).filename().string(); };
    ReportBuilder builder(name(flags->model) + " on " + name(flags->capture), views);
    Progress progress("evaluating", static_cast<int64_t>(views), "views");
    int64_t done = 0;
    options.onView = [&](const ViewResult& result, const ViewPictures& pictures) {
      builder.add(result, pictures);
      progress.update(++done, fmt::format("{:.2f} dB", result.psnr));
    };
    EvaluationReport report = evaluate(renderSource->renderer(), capture, options);
    report.coverage = renderSource->coverage();
    progress.finish();
    if (!std::isfinite(report.psnr)) {
      warn("no pixel of these views could be compared: {} shows nothing in them, or masks exclude all", flags->model);
    }
    // The report comes last: if it cannot be written, the numbers are not lost.
    const bool isJsonAlone = flags->json == "-";
    if (isJsonAlone) {
      fmt::print("{}\n", toJson(report));
    } else {
      if (!flags->json.empty()) writeFileAtomically(flags->json, toJson(report) + "\n");
      fmt::print("{} views: PSNR {:.2f} dB, SSIM {:.4f}{}, exposure {}, {:.2f} s a frame on {}\n", report.views.size(),
                 report.psnr, report.ssim,
                 report.lpips ? fmt::format(", LPIPS ({}) {:.4f}", report.lpipsNet, *report.lpips) : "",
                 describeExposures(report), report.secondsPerFrame, report.device);
    }
    std::fflush(stdout);
    const fs::path page = flags->report.empty() ? fs::path(flags->model) / "report.html" : fs::path(flags->report);
    try {
      builder.write(page, report);
    } catch (const Error& error) {
      throw Error(error.subject(), error.place(), error.reason(), "name another file with --report");
    }
    if (!isJsonAlone) fmt::print("report: {}\n", page.string());
  });
}

}  // namespace tessera
