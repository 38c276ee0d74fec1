// What the subcommands of `tessera bench` share.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>

namespace tessera {

// Adds `tessera bench render`.
void addBenchRender(CLI::App& bench);

// Writes JSON to a file; `-` means standard output, on which nothing else is printed; an empty name writes nothing.
// Throws Error if the file cannot be written.
void writeJson(const std::string& file, const nlohmann::ordered_json& json);

}  // namespace tessera
