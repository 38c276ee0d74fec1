#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <set>

#include "apps/tessera/command_line.h"
#include "apps/tessera/serving.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "compute/cpu/simd_targets.h"
#include "photogrammetry/frame_choice.h"
#include "pipeline/photo_run.h"
#include "pipeline/run_request.h"
#include "representations/methods.h"
#include "train/method_costs.h"

namespace tessera {
namespace {

std::vector<std::string> bakedMethods() {
  std::vector<std::string> names;
  for (const Method* method : methods())
    if (isBaked(*method)) names.emplace_back(method->name);
  return names;
}

// How many times as long steps take as with AVX-512, with which costs were measured. On a machine with AVX2 whose other
// work was as fast, those of `hash` and `volume` took 1.3 times as long; shorter vectors have not been measured.
double vectorSlowness() {
  const std::string best = cpu::simdTargets().front();
  if (best.starts_with("AVX3")) return 1;
  return best == "AVX2" ? 1.3 : 2;
}

// An H200 trains 28 to 40 times the rays of MethodCosts::raysPerSecond in the same time, which depends on the method;
// smaller GPUs are taken to train ten times as many.
TrainingCosts typicalCosts(const MethodCosts& costs, bool onGpu) {
  const double speed = onGpu ? 10 : 1;
  return {.secondsPerStep = costs.secondsPerStep / speed,
          .secondsPerLaterStep = costs.secondsPerLaterStep / speed,
          .slowness = onGpu ? 1 : vectorSlowness(),
          .raysPerSecond = costs.raysPerSecond * speed,
          .bakeSeconds = costs.bakeSeconds,
          .secondsPerBakedMegapixel = costs.secondsPerBakedMegapixel / speed,
          .secondsPerRenderedMegapixel = costs.secondsPerRenderedMegapixel,
          .trainBytes = costs.trainBytes,
          .modelBytes = costs.modelBytes,
          .coarserLevels = costs.coarserLevels};
}

// The flags of the command line, whether their values are the defaults or not.
std::set<std::string> givenFlags(const CLI::App& verb) {
  std::set<std::string> flags;
  for (const CLI::Option* option : verb.get_options())
    if (option->count() > 0) flags.insert(option->get_name());
  return flags;
}

}  // namespace

void addRunVerb(CLI::App& app) {
  auto options = std::make_shared<PhotoRunOptions>();
  options->method = firstMethod(isBaked).name;
  CLI::App* verb =
      app.add_subcommand("run", "a folder of photos, or a video, to a scene: poses, training, baking, evaluation");
  verb->footer(
      "Run again with the same folders after an interruption: what is finished is kept, and what is not given of\n"
      "method, device, length, size, masks, frames and held-out photos is as in the run before.\n\n"
      "Examples:\n  tessera run photos/ place --minutes 10\n  tessera run flight.mp4 place --serve 8080");
  verb->add_option("photos", options->photos,
                   "folder of photos (JPEG, PNG), a video, or photos with poses as `import` reads them")
      ->required();
  verb->add_option("out", options->out, "folder to write")->required();
  verb->add_option("--frames", options->frames,
                   fmt::format("frames to take from a video, the sharpest of as many intervals; 0: one for each {} s, "
                               "but at most {}",
                               kShortestInterval, kMaxDefaultFrames))
      ->capture_default_str()
      ->check(CLI::Range(0, 5000));
  verb->add_option("--masks", options->masks,
                   "folder of masks, black where a photo a/b.jpg is not to be used: a/b.jpg.png, a/b.jpg or a/b.png");
  verb->add_option("--method", options->method, "representation")
      ->capture_default_str()
      ->check(CLI::IsMember(bakedMethods()));
  CLI::Option* steps = verb->add_option("--steps", options->steps, "training steps, instead of minutes")
                           ->check(CLI::Range(int64_t{1}, int64_t{1} << 40));
  verb->add_option("--minutes", options->minutes, "minutes of training")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, 1e7))
      ->excludes(steps);
  verb->add_option(
          "--downscale", options->downscale,
          fmt::format("divides width and height; 0: so that the minutes suffice to train all pixels, until the longer "
                      "side has {} pixels to {}",
                      kShortestSide, kLongestSide))
      ->capture_default_str()
      ->check(CLI::Range(0, 64));
  verb->add_option(
          "--holdout", options->holdout,
          "photos held out for evaluation: every:N, list:FILE, none, or auto: the split of a source with poses, "
          "else every:8")
      ->capture_default_str();
  CLI::Option* dryRun = verb->add_flag(
      "--dry-run", options->dryRun,
      "only state the time, memory and disk of each stage, after features and matches of five photos if there "
      "are at least 15");
  verb->add_option("--from", options->range.from, "run this stage and all after it again");
  CLI::Option* until = verb->add_option("--until", options->range.until, "the last stage to run");
  auto device = std::make_shared<DeviceOptions>();
  addDeviceFlags(*verb, *device);
  auto serving = std::make_shared<ServeOptions>();
  CLI::Option* served = verb->add_option("--serve", serving->server.port,
                                         "then serve the scene and the viewer at this TCP port; 0: any free port")
                            ->check(portRange())
                            ->excludes(dryRun)
                            ->excludes(until);
  verb->add_option("--address", serving->server.address,
                   "with --serve: address to listen on; 0.0.0.0: reachable from other machines")
      ->capture_default_str()
      ->needs(served);
  verb->add_option("--viewer", serving->viewer, "with --serve: folder of the viewer's files")
      ->capture_default_str()
      ->needs(served);
  verb->callback([verb, options, device, serving, served] {
    if (served->count() > 0) {
      requireViewer(serving->viewer);
      requireFreeAddress(serving->server);
    }
    options->device = device->kind;
    options->threads = device->threads;
    adoptEarlierFlags(*options, givenFlags(*verb));
    const auto baked = bakedMethods();
    if (std::find(baked.begin(), baked.end(), options->method) == baked.end())
      throw Error((options->out / "run.json").string(), "flags", "there is no method " + options->method,
                  "give --method");
    device->kind = options->device;
    uint64_t gpuBytes = 0;
    // Throws if there is none, before hours are spent.
    if (device->kind != "cpu") gpuBytes = makeDevice(*device)->ownMemory().bytes;
    options->program = fs::read_symlink("/proc/self/exe").string();
    const Method& method = *findMethod(options->method);
    const bool onGpu = parseVulkanDevice(options->device).has_value();
    options->costs = typicalCosts(method.costs, onGpu);
    options->costsOnCapture = [&method, onGpu, gpuBytes](const Capture& capture) {
      return typicalCosts(costsOnCapture(method, capture, gpuBytes), onGpu);
    };
    options->interrupted = interrupted;
    catchInterrupts();
    std::signal(SIGPIPE, SIG_IGN);  // a program that reads the messages may end first
    try {
      runFromPhotos(*options);
    } catch (const RunInterrupted&) {
      std::fprintf(stderr, "interrupted; run the same command again to go on\n");
      throw CLI::RuntimeError(interruptedStatus());
    }
    if (served->count() == 0) return;
    serving->scene = options->out / "scene";
    serve(*serving);
  });
}

}  // namespace tessera
