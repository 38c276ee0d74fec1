// The single list of representations. Code that needs one item per representation expands this list into a table by
// calling functions that the representations' folders define. There is no self-registration, because linkers drop
// objects that nothing refers to.
//
// TESSERA_REPRESENTATIONS(TRAINED, SCENE) expands to one row per representation: TRAINED(name, Name) for one that is
// trained and rendered as a model only, and SCENE(name, Name) for one whose models can also be baked to scenes. `name`
// is the representation's name in --method, manifest.json and tileset.json, the name of its folder and the prefix of
// its functions; `Name` is the prefix of its types. The first row is the default method of `tessera train`, the first
// SCENE row that of `tessera run` (chosen by docs/benchmarks.md, "Photographs without poses"). A table of methods uses
// all rows:
//
//     #define METHOD(name, Name) &name##Method(),
//     const Method* const kMethods[] = {TESSERA_REPRESENTATIONS(METHOD, METHOD)};
//
// and a table of items that only scenes have (content codecs, drawers) skips the rows that are trained only:
//
//     #define SKIP(name, Name)
//     #define CODEC(name, Name) {#name, &name##Codec()},
//     const Row kCodecs[] = {TESSERA_REPRESENTATIONS(SKIP, CODEC)};
#pragma once

// clang-format off
#define TESSERA_REPRESENTATIONS(TRAINED, SCENE) \
  TRAINED(field, Field)                         \
  SCENE(hash, Hash)                             \
  SCENE(volume, Volume)                         \
  SCENE(mesh, Mesh)
// clang-format on
