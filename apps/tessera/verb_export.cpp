#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/tessera/verbs.h"
#include "export/merf.h"

namespace tessera {

void addExportVerb(CLI::App& app) {
  struct Flags {
    std::string scene, out, format;
    bool json = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* verb = app.add_subcommand("export", "a scene in the files of another program");
  verb->footer("Example:\n  tessera export garden.scene garden.merf --format merf");
  verb->add_option("scene", flags->scene, "scene folder, baked of one contracted block")->required();
  verb->add_option("out", flags->out, "folder to write")->required();
  verb->add_option("--format", flags->format, "merf: what the public web viewer of MERF reads")
      ->required()
      ->check(CLI::IsMember({"merf"}));
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  verb->callback([flags] {
    const MerfExport exported = exportMerf(flags->scene, flags->out);
    if (flags->json) {
      const nlohmann::ordered_json result = {{"format", flags->format},
                                             {"bytes_on_disk", exported.bytesOnDisk},
                                             {"macroblocks", exported.macroblocks},
                                             {"slices", exported.slices},
                                             {"near", exported.near}};
      fmt::print("{}\n", result.dump(2));
      return;
    }
    fmt::print("{}: {:.1f} MB, {} macroblocks in {} slices; open the viewer with ?quality=high&near={:.3g}&dir=...\n",
               flags->out, static_cast<double>(exported.bytesOnDisk) / 1e6, exported.macroblocks, exported.slices,
               exported.near);
  });
}

}  // namespace tessera
