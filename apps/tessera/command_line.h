// What the programs' command lines share: flags, and what becomes of errors.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "compute/device.h"

namespace tessera {

// Flags of whatever computes.
void addDeviceFlags(CLI::App& verb, DeviceOptions& options);

// Of --size: "1280x720". Throws CLI::ValidationError.
void parsePictureSize(const std::string& size, int& width, int& height);

// Parses, then runs; says in one line on stderr what went wrong. → what the program ends with: 0, 1 (failed), 2
// (usage), or as a CLI::RuntimeError has it.
// `moreMemory`: what to do where the machine has too little.
int runCommandLine(
    CLI::App& app, int argc, char** argv, const std::string& moreMemory, const std::function<void()>& run = [] {});

}  // namespace tessera
