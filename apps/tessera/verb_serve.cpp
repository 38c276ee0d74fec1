#include <fmt/format.h>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "serve/http_server.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

bool isLoopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1";
}

}  // namespace

void addServeVerb(CLI::App& app) {
  struct Flags {
    std::string scene, viewer = TESSERA_VIEWER;
    HttpServerSettings server;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("serve", "a scene and its viewer to browsers");
  verb->footer("Example:\n  tessera serve garden.scene --port 8080");
  verb->add_option("scene", flags->scene, "scene folder")->required();
  verb->add_option("--port", flags->server.port, "0: one that is free")->capture_default_str();
  verb->add_option("--address", flags->server.address, "of this machine; 0.0.0.0: for everyone who can reach it")
      ->capture_default_str();
  verb->add_option("--viewer", flags->viewer, "folder of the viewer's files (tools/build-web.sh makes it)")
      ->capture_default_str();
  verb->callback([flags] {
    const Tileset tileset = readTileset(flags->scene);
    if (!fs::exists(fs::path(flags->viewer) / "index.html")) {
      throw Error(flags->viewer, "", "holds no viewer", "run tools/build-web.sh, or name another folder with --viewer");
    }
    // Pages of other sites cannot have a loopback server read for them by giving it a name of theirs.
    std::vector<std::string> hosts;
    if (isLoopback(flags->server.address)) hosts = {"localhost", "127.0.0.1", "::1", flags->server.address};
    const StaticSite site({{"", flags->viewer}, {"scene", flags->scene}}, hosts);
    HttpServer server(site, flags->server);
    const bool isV6 = flags->server.address.find(':') != std::string::npos;
    fmt::print("{}: open http://{}:{}/ (Ctrl-C ends)\n", tileset.name.empty() ? flags->scene : tileset.name,
               isV6 ? "[" + flags->server.address + "]" : flags->server.address, server.port());
    std::fflush(stdout);
    catchInterrupts();
    server.run(interrupted);
  });
}

}  // namespace tessera
