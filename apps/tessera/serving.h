// Serves a scene or a world, and the viewer, to browsers.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "base/file.h"
#include "serve/http_server.h"

namespace tessera {

struct ServeOptions {
  fs::path scene;                       // folder of a scene; world.json, or its folder
  std::string viewer = TESSERA_VIEWER;  // folder of the viewer's files
  HttpServerSettings server;
};

// Accepts the ports that a flag can name.
CLI::Validator portRange();

// Throws Error if the folder holds no viewer.
void requireViewer(const std::string& viewer);

// Prints the address, and serves until an interrupt. Throws Error if there is nothing to serve, no viewer, or if the
// address cannot be listened on.
void serve(const ServeOptions& options);

}  // namespace tessera
