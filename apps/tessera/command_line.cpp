#include "apps/tessera/command_line.h"

#include <cstdio>
#include <exception>
#include <filesystem>

#include "base/error.h"

namespace tessera {

void addDeviceFlags(CLI::App& verb, DeviceOptions& options) {
  verb.add_option("--device", options.kind,
                  "what computes: auto (a GPU, else cpu), cpu, vulkan, vulkan:<index or name> or reference")
      ->capture_default_str();
  verb.add_option("--threads", options.threads, "CPU threads; 0: all cores")
      ->capture_default_str()
      ->check(CLI::Range(0, 1024));
}

void parsePictureSize(const std::string& size, int& width, int& height) {
  int used = 0, wide = 0, high = 0;
  if (std::sscanf(size.c_str(), "%dx%d%n", &wide, &high, &used) != 2 || used != static_cast<int>(size.size()) ||
      wide < 1 || high < 1 || wide > 16384 || high > 16384) {
    throw CLI::ValidationError("--size", "'" + size + "' is not of the form 1280x720");
  }
  width = wide;
  height = high;
}

int runCommandLine(CLI::App& app, int argc, char** argv, const std::string& moreMemory,
                   const std::function<void()>& run) {
  try {
    app.parse(argc, argv);
    run();
    return 0;
  } catch (const CLI::RuntimeError& ended) {
    return ended.get_exit_code();  // the status that the verb chose
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const Error& error) {
    std::fprintf(stderr, "tessera: error: %s\n", error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    const Error said(error.path1().string(), "", error.code().message(),
                     "check that the disk is mounted and has free space, and that the folder is writable");
    std::fprintf(stderr, "tessera: error: %s\n", said.what());
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "tessera: error: memory: this machine does not have enough; %s\n", moreMemory.c_str());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tessera: error: internal: %s; please report it\n", error.what());
  }
  return 1;
}

}  // namespace tessera
