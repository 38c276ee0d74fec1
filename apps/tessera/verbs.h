// The verbs of the command line. Each file verb_NAME.cpp declares the flags of its verb and calls one library function.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/tessera/command_line.h"
#include "base/file.h"

namespace tessera {

// Each function adds one verb to `app`; the verb's work is done when it is given on the command line.
void addRunVerb(CLI::App& app);
void addSynthVerb(CLI::App& app);
void addImportVerb(CLI::App& app);
void addTrainVerb(CLI::App& app);
void addBakeVerb(CLI::App& app);
void addEvalVerb(CLI::App& app);
void addRenderVerb(CLI::App& app);
void addServeVerb(CLI::App& app);
void addViewVerb(CLI::App& app);
void addExportVerb(CLI::App& app);
void addInfoVerb(CLI::App& app);
void addBenchVerb(CLI::App& app);

// Returns whether SIGINT, SIGTERM or SIGHUP has been received; a second signal ends the process at once, unless the
// parent process passes on what both have received.
bool interrupted();
// Returns the exit status of a verb that was interrupted before its end, for CLI::RuntimeError: 130 for SIGINT, 143 for
// SIGTERM, 129 for SIGHUP.
int interruptedStatus();
void catchInterrupts();

}  // namespace tessera
