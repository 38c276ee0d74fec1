#include <fmt/format.h>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "serve/http_server.h"
#include "serve/world_file.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

bool isLoopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1";
}

// What is served beside the viewer.
struct Served {
  std::string name;   // for people
  SiteFolder folder;  // of the site
  std::string start;  // of the site
};

// Throws Error where there is neither a scene nor a world, or one that cannot be served.
Served openServed(const fs::path& path) {
  if (const auto world = worldFileAt(path)) {
    requireScenesBeside(*world);
    return {world->string(), {"world", fs::absolute(*world).parent_path()}, viewerOfWorld(world->filename().string())};
  }
  const Tileset tileset = readTileset(path);
  return {tileset.name.empty() ? path.string() : tileset.name, {"scene", path}, ""};
}

}  // namespace

void addServeVerb(CLI::App& app) {
  struct Flags {
    std::string scene, viewer = TESSERA_VIEWER;
    HttpServerSettings server;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("serve", "a scene or a world, and its viewer, to browsers");
  verb->footer("Example:\n  tessera serve garden.scene --port 8080\n  tessera serve worlds/world.json");
  verb->add_option("scene", flags->scene, "scene folder; or world.json of the viewer, or the folder that it lies in")
      ->required();
  verb->add_option("--port", flags->server.port, "0: one that is free")->capture_default_str();
  verb->add_option("--address", flags->server.address, "of this machine; 0.0.0.0: for everyone who can reach it")
      ->capture_default_str();
  verb->add_option("--viewer", flags->viewer, "folder of the viewer's files (tools/build-web.sh makes it)")
      ->capture_default_str();
  verb->callback([flags] {
    const Served served = openServed(flags->scene);
    if (!fs::exists(fs::path(flags->viewer) / "index.html")) {
      throw Error(flags->viewer, "", "holds no viewer", "run tools/build-web.sh, or name another folder with --viewer");
    }
    // Pages of other sites cannot have a loopback server read for them by giving it a name of theirs.
    std::vector<std::string> hosts;
    if (isLoopback(flags->server.address)) hosts = {"localhost", "127.0.0.1", "::1", flags->server.address};
    const StaticSite site({{"", flags->viewer}, served.folder}, hosts, served.start);
    HttpServer server(site, flags->server);
    const bool isV6 = flags->server.address.find(':') != std::string::npos;
    fmt::print("{}: open http://{}:{}/ (Ctrl-C ends)\n", served.name,
               isV6 ? "[" + flags->server.address + "]" : flags->server.address, server.port());
    std::fflush(stdout);
    catchInterrupts();
    server.run(interrupted);
  });
}

}  // namespace tessera
