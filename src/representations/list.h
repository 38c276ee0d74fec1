// The single list of representations. Code that needs one item per representation expands this list into a table by
// calling functions that the representations' folders define. There is no self-registration, because linkers drop
// objects that nothing refers to.
//
// TESSERA_REPRESENTATIONS(TRAINED, CPU_SCENE, SCENE) expands to one row per representation: TRAINED(name, Name) for one
// that is trained and rendered as a model only, SCENE(name, Name) for one whose models can also be baked to scenes, and
// CPU_SCENE(name, Name) if these have no drawer on the GPU. `name` is the representation's name in --method,
// manifest.json and tileset.json, the name of its folder and the prefix of its functions; `Name` is the prefix of its
// types. The first row is the default method of `tessera train`. A table of methods uses all rows:
//
//     #define METHOD(name, Name) &name##Method(),
//     const Method* const kMethods[] = {TESSERA_REPRESENTATIONS(METHOD, METHOD, METHOD)};
//
// and a table of items that only scenes have (content codecs, drawers on the CPU) skips the rows that are trained only:
//
//     #define SKIP(name, Name)
//     #define CODEC(name, Name) {#name, &name##Codec()},
//     const Row kCodecs[] = {TESSERA_REPRESENTATIONS(SKIP, CODEC, CODEC)};
#pragma once

// clang-format off
#define TESSERA_REPRESENTATIONS(TRAINED, CPU_SCENE, SCENE) \
  TRAINED(field, Field)                                    \
  SCENE(volume, Volume)                                    \
  SCENE(hash, Hash)                                        \
  CPU_SCENE(mesh, Mesh)
// clang-format on
