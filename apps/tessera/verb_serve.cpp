#include "apps/tessera/serving.h"
#include "apps/tessera/verbs.h"

namespace tessera {

void addServeVerb(CLI::App& app) {
  auto options = std::make_shared<ServeOptions>();
  CLI::App* verb = app.add_subcommand("serve", "a scene or a world, and its viewer, to browsers");
  verb->footer("Example:\n  tessera serve garden.scene --port 8080\n  tessera serve worlds/world.json");
  verb->add_option("scene", options->scene, "scene folder; or world.json of the viewer, or the folder that it lies in")
      ->required();
  verb->add_option("--port", options->server.port, "TCP port; 0: any free port")
      ->capture_default_str()
      ->check(portRange());
  verb->add_option("--address", options->server.address, "address to listen on; 0.0.0.0: reachable from other machines")
      ->capture_default_str();
  verb->add_option("--viewer", options->viewer, "folder of the viewer's files (tools/build-web.sh makes it)")
      ->capture_default_str();
  verb->callback([options] { serve(*options); });
}

}  // namespace tessera
