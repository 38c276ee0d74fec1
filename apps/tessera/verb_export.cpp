#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <nlohmann/json.hpp>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "export/gltf.h"
#include "export/merf.h"
#include "export/mobilenerf.h"
#include "export/unreal.h"

namespace tessera {
namespace {

struct ExportFlags {
  std::string scene, out, format;
  uint32_t level = 0;
  bool split = false, json = false;
};

using Json = nlohmann::ordered_json;

// Each prints one line for people, or returns what --json prints.
Json runMerfExport(const ExportFlags& flags) {
  const MerfExport exported = exportMerf(flags.scene, flags.out);
  if (!flags.json) {
    fmt::print("{}: {:.1f} MB, {} macroblocks in {} slices; open the viewer with ?quality=high&near={:.3g}&dir=...\n",
               flags.out, static_cast<double>(exported.bytesOnDisk) / 1e6, exported.macroblocks, exported.slices,
               exported.near);
  }
  return {{"bytes_on_disk", exported.bytesOnDisk},
          {"macroblocks", exported.macroblocks},
          {"slices", exported.slices},
          {"near", exported.near}};
}

Json runGltfExport(const ExportFlags& flags) {
  const GltfExport exported = exportGltf(flags.scene, flags.out, {.level = flags.level, .isSplit = flags.split});
  if (!flags.json) {
    fmt::print("{}: {:.1f} MB, {} triangles of {} tiles in {} {}\n", flags.out,
               static_cast<double>(exported.bytesOnDisk) / 1e6, exported.triangles, exported.tiles, exported.files,
               exported.files == 1 ? "file" : "files");
  }
  return {{"bytes_on_disk", exported.bytesOnDisk},
          {"level", flags.level},
          {"files", exported.files},
          {"tiles", exported.tiles},
          {"triangles", exported.triangles}};
}

Json runUnrealExport(const ExportFlags& flags) {
  const UnrealExport exported = exportUnreal(flags.scene, flags.out, {.level = flags.level});
  if (!flags.json) {
    fmt::print("{}: {:.1f} MB, {} triangles in {} parts; run {}/import_scene.py in the Unreal editor\n", flags.out,
               static_cast<double>(exported.bytesOnDisk) / 1e6, exported.triangles, exported.parts, flags.out);
  }
  return {{"bytes_on_disk", exported.bytesOnDisk},
          {"level", flags.level},
          {"parts", exported.parts},
          {"decoders", exported.decoders},
          {"triangles", exported.triangles}};
}

Json runMobilenerfExport(const ExportFlags& flags) {
  const MobilenerfExport exported = exportMobilenerf(flags.scene, flags.out, {.level = flags.level});
  if (!flags.json) {
    fmt::print("{}: {:.1f} MB, {} triangles in {} shapes; one network for {} gives colours {:.1f} dB from theirs\n",
               flags.out, static_cast<double>(exported.bytesOnDisk) / 1e6, exported.triangles, exported.shapes,
               exported.decoders == 1 ? "the decoder" : fmt::format("{} decoders", exported.decoders),
               exported.refit.psnr);
  }
  return {{"bytes_on_disk", exported.bytesOnDisk},
          {"level", flags.level},
          {"shapes", exported.shapes},
          {"decoders", exported.decoders},
          {"triangles", exported.triangles},
          {"refit", {{"rms", exported.refit.rms}, {"psnr", exported.refit.psnr}, {"colours", exported.refit.colours}}}};
}

void requireFormat(const ExportFlags& flags, const char* flag, bool isGiven,
                   std::initializer_list<const char*> formats) {
  if (!isGiven || std::find(formats.begin(), formats.end(), flags.format) != formats.end()) return;
  throw Error(flag, "", fmt::format("has no meaning for the format {}", flags.format), "leave it out");
}

}  // namespace

void addExportVerb(CLI::App& app) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* verb = app.add_subcommand("export", "a scene in the files of another program");
  verb->footer(
      "Examples:\n  tessera export garden.scene garden.glb --format gltf\n"
      "  tessera export garden.scene garden.merf --format merf");
  verb->add_option("scene", flags->scene, "scene folder")->required();
  verb->add_option("out", flags->out, "folder to write; a file that ends in .glb for gltf without --split")->required();
  verb->add_option(
          "--format", flags->format,
          "gltf: ordinary triangles of a mesh scene; merf: what the public web viewer of MERF reads, of a "
          "volume scene baked of one contracted block; mobilenerf: what the public web viewer of MobileNeRF reads, of "
          "a mesh scene; unreal: neural textures of a mesh scene, and a script that imports them into Unreal Engine")
      ->required()
      ->check(CLI::IsMember({"gltf", "merf", "mobilenerf", "unreal"}));
  const CLI::Option* level =
      verb->add_option("--level", flags->level, "gltf, mobilenerf, unreal: level of detail; 0 is the finest");
  verb->add_flag("--split", flags->split, "gltf: a folder with one file for each tile");
  verb->add_flag("--json", flags->json, "print the result as one JSON object");
  verb->callback([flags, level] {
    requireFormat(*flags, "--level", level->count() > 0, {"gltf", "mobilenerf", "unreal"});
    requireFormat(*flags, "--split", flags->split, {"gltf"});
    Json result = {{"format", flags->format}};
    result.update(flags->format == "gltf"         ? runGltfExport(*flags)
                  : flags->format == "mobilenerf" ? runMobilenerfExport(*flags)
                  : flags->format == "unreal"     ? runUnrealExport(*flags)
                                                  : runMerfExport(*flags));
    if (flags->json) fmt::print("{}\n", result.dump(2));
  });
}

}  // namespace tessera
