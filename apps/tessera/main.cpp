// tessera: photographs of a large place to a neural scene. Every verb is a library function; errors are caught here.

#include <malloc.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>

#include "apps/tessera/verbs.h"
#include "base/error.h"

namespace tessera {
namespace {

volatile std::sig_atomic_t firstSignal = 0;

void onInterrupt(int signal) {
  if (firstSignal != 0) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  firstSignal = signal;
}

}  // namespace

bool interrupted() {
  return firstSignal != 0;
}

int interruptedStatus() {
  return 128 + firstSignal;
}

void catchInterrupts() {
  std::signal(SIGINT, onInterrupt);
  std::signal(SIGTERM, onInterrupt);
}

void addDeviceFlags(CLI::App& verb, DeviceOptions& options) {
  verb.add_option("--device", options.kind,
                  "what computes: auto (a graphics card, else cpu), cpu, vulkan, vulkan:<index or name> or reference")
      ->capture_default_str();
  verb.add_option("--threads", options.threads, "processor threads; 0: all cores")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
}

}  // namespace tessera

int main(int argc, char** argv) {
  // Photos come and go: their memory goes back to the system each time, however large those before were. (By default
  // glibc would keep it, in pieces that others do not fit.)
  mallopt(M_MMAP_THRESHOLD, 1 << 19);
  CLI::App app(
      "tessera turns photographs of a large place into a neural scene.\n"
      "  photos -import-> capture -train-> model -bake-> scene\n"
      "  model or scene -eval, render-> numbers, pictures\n"
      "  scene -serve-> browser");
  app.name("tessera");
  app.require_subcommand(1);
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", TESSERA_VERSION);
  tessera::addSynthVerb(app);
  tessera::addImportVerb(app);
  tessera::addTrainVerb(app);
  tessera::addBakeVerb(app);
  tessera::addEvalVerb(app);
  tessera::addRenderVerb(app);
  tessera::addServeVerb(app);
  tessera::addExportVerb(app);
  tessera::addInfoVerb(app);
  tessera::addBenchVerb(app);
  try {
    const auto isMeant = [&](const CLI::App* verb) { return verb->get_name() == argv[1]; };
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(isMeant).empty()) {
      std::fprintf(stderr, "tessera: there is no verb '%s'; tessera --help lists them\n", argv[1]);
      return 2;
    }
    app.parse(argc, argv);
    return 0;
  } catch (const CLI::RuntimeError& ended) {
    return ended.get_exit_code();  // as the verb wants it
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "tessera: error: %s\n", error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    const tessera::Error said(error.path1().string(), "", error.code().message(),
                              "see that the disk is there and has room, and that the folder may be changed");
    std::fprintf(stderr, "tessera: error: %s\n", said.what());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr,
                 "tessera: error: memory: this machine has not enough; lower --set photo_budget_mib, grid_log2_size or "
                 "fine_log2_size; "
                 "of field samples_per_pass; of volume texels_per_step, or keep few blocks with --resident-blocks\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tessera: error: internal: %s; please report it\n", error.what());
  }
  return 1;
}
