#include <fmt/format.h>

#include "apps/tessera/folder_kind.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "representations/methods.h"
#include "serve/http_server.h"
#include "serve/world_file.h"
#include "tiles/scene_folder.h"
#include "train/model_folder.h"

namespace tessera {
namespace {

bool isLoopback(const std::string& address) {
  return address.starts_with("127.") || address == "::1";
}

bool isMissing(const fs::path& path) {
  std::error_code status;
  return fs::status(path, status).type() == fs::file_type::not_found;
}

// Throws Error if the path is not a scene; the message states what it is instead, and how to make a scene of it.
void requireScene(const fs::path& path) {
  if (!isMissing(path / "tileset.json")) return;
  const std::string name = path.string(), another = "name the folder of a scene, or the world.json of a world";
  if (isMissing(path)) throw Error(name, "", "there is no such file or folder", another);
  if (!fs::is_directory(path)) throw Error(name, "", "is neither the folder of a scene nor a world.json", another);
  const std::string intoScene =
      fmt::format(" MODEL --method {}, then tessera bake MODEL SCENE", firstMethod(isBaked).name);
  switch (kindOfFolder(path)) {
    case FolderKind::scene:
      return;
    case FolderKind::source:
      throw Error(name, "", "is a folder of photos that are not imported yet, not a scene",
                  "import, train and bake them first: tessera import " + name + " CAPTURE, then tessera train CAPTURE" +
                      intoScene);
    case FolderKind::capture:
      throw Error(name, "", "is a capture, not a scene", "train and bake it first: tessera train " + name + intoScene);
    case FolderKind::model: {
      const auto manifest = ModelFolder(path).manifest();
      if (!manifest) {
        throw Error(name, "", "is a model that is not trained yet, not a scene",
                    "train it, then bake it: tessera bake " + name + " SCENE");
      }
      if (const Method* method = findMethod(manifest->method); method == nullptr || !isBaked(*method)) {
        throw Error(name, "", "is a model of --method " + manifest->method + ", of which no scene can be baked",
                    fmt::format("train one with --method {}, and bake that; tessera view shows this one",
                                namesOfMethods(isBaked, "or")));
      }
      throw Error(name, "", "is a model, not a scene", "bake it first: tessera bake " + name + " SCENE");
    }
    case FolderKind::other:
      throw Error(name, "", "holds neither a scene (tileset.json) nor a world (world.json)", another);
  }
}

// Checks the value of --port. CLI11's own message would not state the valid range.
std::string portError(const std::string& text) {
  int port = 0;
  const bool isPort = CLI::detail::lexical_cast(text, port) && port >= 0 && port <= 65535;
  return isPort ? "" : fmt::format("'{}' is not a port: ports are whole numbers from 0 to 65535", text);
}

// A scene or a world, as it is served beside the viewer.
struct Served {
  std::string name;   // for display
  SiteFolder folder;  // of the site
  std::string start;  // path of the site at which the viewer starts
};

// Throws Error if the path names neither a scene nor a world, or one that cannot be served.
Served openServed(const fs::path& path) {
  if (const auto world = worldFileAt(path)) {
    requireWorld(*world);
    return {world->string(), {"world", fs::absolute(*world).parent_path()}, viewerOfWorld(world->filename().string())};
  }
  requireScene(path);
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
  verb->add_option("--port", flags->server.port, "TCP port; 0: any free port")
      ->capture_default_str()
      ->check(CLI::Validator(portError, "0 to 65535"));
  verb->add_option("--address", flags->server.address, "address to listen on; 0.0.0.0: reachable from other machines")
      ->capture_default_str();
  verb->add_option("--viewer", flags->viewer, "folder of the viewer's files (tools/build-web.sh makes it)")
      ->capture_default_str();
  verb->callback([flags] {
    const Served served = openServed(flags->scene);
    if (!fs::exists(fs::path(flags->viewer) / "index.html")) {
      throw Error(flags->viewer, "", "holds no viewer", "run tools/build-web.sh, or name another folder with --viewer");
    }
    // Guards against DNS rebinding: pages of other sites must not read from a loopback server under a host name of
    // theirs.
    std::vector<std::string> hosts;
    if (isLoopback(flags->server.address)) hosts = {"localhost", "127.0.0.1", "::1", flags->server.address};
    const StaticSite site({{"", flags->viewer}, served.folder}, hosts, served.start);
    HttpServer server(site, flags->server);
    catchInterrupts();
    const bool isV6 = flags->server.address.find(':') != std::string::npos;
    fmt::print("{}: open http://{}:{}/ (Ctrl-C ends)\n", served.name,
               isV6 ? "[" + flags->server.address + "]" : flags->server.address, server.port());
    std::fflush(stdout);
    server.run(interrupted);
  });
}

}  // namespace tessera
