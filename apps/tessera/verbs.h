// The verbs of the command line. Each file verb_NAME.cpp declares its flags and calls one library function.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "apps/tessera/command_line.h"
#include "base/file.h"

namespace tessera {

// Each adds its verb to `app`, which does its work when the verb was given.
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

// True once SIGINT or SIGTERM has come; a second one ends the process at once.
bool interrupted();
// What a verb that was interrupted before its end ends with, as CLI::RuntimeError: 130 for SIGINT, 143 for SIGTERM.
int interruptedStatus();
void catchInterrupts();

}  // namespace tessera
