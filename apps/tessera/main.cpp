// tessera: turns photographs of a large place into a neural scene. Every verb calls one library function; errors are
// caught here.

#include <malloc.h>

#include <atomic>
#include <csignal>
#include <cstdio>

#include "apps/tessera/verbs.h"

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

}  // namespace tessera

int main(int argc, char** argv) {
  // Returns the memory of evicted photos to the system, whatever their size. By default, glibc raises this threshold
  // and keeps the memory in fragments that other allocations do not fit.
  mallopt(M_MMAP_THRESHOLD, 1 << 19);
  CLI::App app(
      "tessera turns photographs of a large place into a neural scene.\n"
      "  photos -import-> capture -train-> model -bake-> scene\n"
      "  model or scene -eval, render-> numbers, images\n"
      "  scene -serve-> browser, model or scene -view-> window");
  app.name("tessera");
  app.require_subcommand(1);
  app.option_defaults()->always_capture_default();
  app.set_version_flag("--version", TESSERA_VERSION);
  tessera::addRunVerb(app);
  tessera::addSynthVerb(app);
  tessera::addImportVerb(app);
  tessera::addTrainVerb(app);
  tessera::addBakeVerb(app);
  tessera::addEvalVerb(app);
  tessera::addRenderVerb(app);
  tessera::addServeVerb(app);
  tessera::addViewVerb(app);
  tessera::addExportVerb(app);
  tessera::addInfoVerb(app);
  tessera::addBenchVerb(app);
  const auto isMeant = [&](const CLI::App* verb) { return verb->get_name() == argv[1]; };
  if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(isMeant).empty()) {
    std::fprintf(stderr, "tessera: there is no verb '%s'; tessera --help lists them\n", argv[1]);
    return 2;
  }
  return tessera::runCommandLine(
      app, argc, argv,
      "lower, with --set, those of photo_budget_mib, samples_per_micro_batch, samples_per_step, texels_per_step, "
      "grid_log2_size and fine_log2_size that the method has, or keep few blocks in memory with --resident-blocks "
      "where the method allows it");
}
