// `tessera export --format unreal`: exports a level of detail of a `mesh` scene for Unreal Engine, with its neural
// textures and the networks that turn them into colours. docs/unreal.md describes the files and how to import them.
#pragma once

#include "base/file.h"

namespace tessera {

struct UnrealExportSettings {
  uint32_t level = 0;  // of detail; 0 is the finest
  int threads = 0;     // that infer maps; 0: as many as the machine has
};

struct UnrealExport {
  uint64_t bytesOnDisk = 0, triangles = 0;
  uint32_t parts = 0, decoders = 0;  // parts with triangles, different networks
};

// Writes the folder `out`, which appears complete or not at all and may replace an older export: for each part a mesh
// (.glb), nine maps in BC4 (.dds) and the same maps as images (.png), the networks (.hlsl, .ush, .json), `scene.json`,
// which names all of them, and `import_scene.py`, which imports them into a project. One content is in memory at a
// time. Throws Error unless `scene` is a scene of mesh that has this level.
UnrealExport exportUnreal(const fs::path& scene, const fs::path& out, const UnrealExportSettings& settings = {});

// The script of the Unreal editor that imports the folder that it lies in (unreal_script.cpp).
extern const char* const kUnrealScript;

}  // namespace tessera
