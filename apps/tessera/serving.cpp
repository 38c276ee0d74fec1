#include "apps/tessera/serving.h"

#include <fmt/format.h>

#include "apps/tessera/folder_kind.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "representations/methods.h"
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

CLI::Validator portRange() {
  return CLI::Validator(portError, "0 to 65535");
}

void requireViewer(const std::string& viewer) {
  if (fs::exists(fs::path(viewer) / "index.html")) return;
  throw Error(viewer, "", "holds no viewer", "run tools/build-web.sh, or name another folder with --viewer");
}

void serve(const ServeOptions& options) {
  const Served served = openServed(options.scene);
  requireViewer(options.viewer);
  // Guards against DNS rebinding: pages of other sites must not read from a loopback server under a host name of
  // theirs.
  const std::string& address = options.server.address;
  std::vector<std::string> hosts;
  if (isLoopback(address)) hosts = {"localhost", "127.0.0.1", "::1", address};
  const StaticSite site({{"", options.viewer}, served.folder}, hosts, served.start);
  HttpServer server(site, options.server);
  catchInterrupts();
  const bool isV6 = address.find(':') != std::string::npos;
  fmt::print("{}: open http://{}:{}/ (Ctrl-C ends)\n", served.name, isV6 ? "[" + address + "]" : address,
             server.port());
  std::fflush(stdout);
  server.run(interrupted);
}

}  // namespace tessera
