// What the command lines of the programs share: flags, and the handling of errors.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "compute/device.h"

namespace tessera {

// Adds the flags of every verb that computes on a device.
void addDeviceFlags(CLI::App& verb, DeviceOptions& options);

// Parses the value of --size, "1280x720". Throws CLI::ValidationError if it is not of this form.
void parsePictureSize(const std::string& size, int& width, int& height);

// Parses the command line, calls `run`, and reports an error as one line on stderr. Returns the exit status: 0, 1
// (failed), 2 (usage error), or the status of a CLI::RuntimeError. `moreMemory`: the advice to print if the machine
// runs out of memory.
int runCommandLine(
    CLI::App& app, int argc, char** argv, const std::string& moreMemory, const std::function<void()>& run = [] {});

}  // namespace tessera
