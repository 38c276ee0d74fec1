// tessera-viewer: the window of `tessera view`. It is a separate program, so that tessera itself needs no desktop
// libraries.
#include "apps/tessera/command_line.h"
#include "apps/viewer/viewer.h"

int main(int argc, char** argv) {
  using namespace tessera;
  CLI::App app("tessera view: a window in which people move through a scene, a world, or a model in training.");
  app.name("tessera view");
  app.footer(
      "Examples:\n  tessera view fox.scene\n"
      "  tessera view world.json       several scenes, and models among them\n"
      "  tessera view fox.model        shows each checkpoint of a training that is running\n"
      "  tessera view city.scene --views city.capture --from drone_0007.jpg");
  app.option_defaults()->always_capture_default();
  ViewOptions view;
  WindowOptions window;
  std::string size = "1280x720", mode = "map";
  app.add_option("what", view.folder, "scene or model folder, or world.json")->required();
  app.add_option("--views", view.views,
                 "capture whose photo poses can be visited; default: the one that the model was trained on");
  app.add_option("--from", window.from, "photo whose view to begin with: the end of its name");
  app.add_option("--mode", mode, "how to move")->check(CLI::IsMember({"map", "orbit", "fly"}));
  app.add_option("--size", size, "size of the window, such as 1280x720");
  app.add_option("--detail", view.maximumScreenSpaceError,
                 "scenes only: pixels of error that may be seen; 0: the finest everywhere")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--memory-mib", view.memoryMiB,
                 "scenes only: memory for the contents, on the GPU or the CPU; the scenes of a world share it")
      ->check(CLI::Range(1.0, 1e9));
  bool hidden = false;
  app.add_flag("--no-panel", hidden, "begin without the panel (F1 shows it)");
  app.add_option("--screenshot", window.screenshot, "write this PNG once the image is complete, and end");
  addDeviceFlags(app, view.device);
  return runCommandLine(app, argc, argv, "lower --memory-mib, or make the window smaller with --size", [&] {
    parsePictureSize(size, window.width, window.height);
    window.panels = !hidden;
    window.mode = mode == "fly" ? NavigationMode::fly : mode == "orbit" ? NavigationMode::orbit : NavigationMode::map;
    runViewer(view, window);
  });
}
