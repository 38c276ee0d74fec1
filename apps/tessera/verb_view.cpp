#include <dlfcn.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/file.h"

namespace tessera {
namespace {

// Runs the viewer's window, a separate program (apps/viewer), so that this program needs no desktop libraries.
[[noreturn]] void execViewer(const std::vector<std::string>& arguments) {
  const fs::path viewer = fs::read_symlink("/proc/self/exe").parent_path() / "tessera-viewer";
  if (!fs::exists(viewer)) {
    throw Error(viewer.string(), "", "this tessera was built without its window",
                "build it with TESSERA_VULKAN=ON and TESSERA_WINDOW=ON, or use tessera serve");
  }
  if (dlopen("libglfw.so.3", RTLD_LAZY) == nullptr) {
    throw Error("libglfw.so.3", "", "cannot be loaded",
                "install libglfw3 (apt-get install libglfw3), or use tessera serve");
  }
  std::vector<std::string> all = {viewer.string()};
  all.insert(all.end(), arguments.begin(), arguments.end());
  std::vector<char*> pointers;
  for (std::string& argument : all) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  execv(viewer.c_str(), pointers.data());
  throw Error(viewer.string(), "", std::strerror(errno), "build or install tessera again");
}

}  // namespace

void addViewVerb(CLI::App& app) {
  CLI::App* verb = app.add_subcommand("view", "a scene, a world, or a model in training, in a window to move through");
  verb->set_help_flag();  // the viewer has flags of its own and answers tessera view --help
  verb->prefix_command();
  verb->callback([verb] { execViewer(verb->remaining()); });
}

}  // namespace tessera
