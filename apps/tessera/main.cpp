// tessera: turns photographs of a large place into a neural scene. Every verb calls one library function; errors are
// caught here.

#include <fcntl.h>
#include <malloc.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <ctime>

#include "apps/tessera/verbs.h"

namespace tessera {
namespace {

volatile std::sig_atomic_t firstSignal = 0;
timespec firstTime{};

double secondsSinceFirst() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<double>(now.tv_sec - firstTime.tv_sec) +
         1e-9 * static_cast<double>(now.tv_nsec - firstTime.tv_nsec);
}

void onInterrupt(int signal, siginfo_t* info, void*) {
  constexpr double kPassedOn = 2;  // seconds
  if (firstSignal == 0) {
    ::clock_gettime(CLOCK_MONOTONIC, &firstTime);
    firstSignal = signal;
    return;
  }
  // A system that shuts down signals `run` and the verb that it runs, and `run` passes its signal on.
  if (info->si_pid == ::getppid() && secondsSinceFirst() < kPassedOn) return;
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

// Descriptors 0 to 2 that are closed would be those of the next files, which would get this program's messages.
void openStandardStreams() {
  int next = 0;
  do next = ::open("/dev/null", O_RDWR);
  while (next >= 0 && next <= STDERR_FILENO);
  if (next >= 0) ::close(next);
}

}  // namespace

bool interrupted() {
  return firstSignal != 0;
}

int interruptedStatus() {
  return 128 + firstSignal;
}

void catchInterrupts() {
  struct sigaction action {};
  action.sa_sigaction = onInterrupt;
  action.sa_flags = SA_SIGINFO | SA_RESTART;
  ::sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before {};
    // `nohup` has hangups ignored.
    if (::sigaction(signal, nullptr, &before) == 0 && signal == SIGHUP && before.sa_handler == SIG_IGN) continue;
    ::sigaction(signal, &action, nullptr);
  }
}

}  // namespace tessera

int main(int argc, char** argv) {
  tessera::openStandardStreams();
  std::signal(SIGCHLD, SIG_DFL);  // else no program that is started could be waited for
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
