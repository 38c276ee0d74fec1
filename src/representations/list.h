// The one list of representations. Whoever needs something of each expands it into a small table of that, calling
// functions that the folders define: nothing registers itself, as linkers drop what nothing refers to.
//
// TESSERA_REPRESENTATIONS(TRAINED, SCENE) has a row for each: TRAINED(name, Name) for one that is trained and drawn as
// a model only, SCENE(name, Name) for one whose models are baked to scenes as well. `name` is what --method,
// manifest.json and tileset.json call it, the name of the folder, and what functions begin with; types begin with
// `Name`. The first is what `tessera train` takes where nothing is said. A table of methods has all rows:
//
//     #define METHOD(name, Name) &name##Method(),
//     const Method* const kMethods[] = {TESSERA_REPRESENTATIONS(METHOD, METHOD)};
//
// and a table of what only scenes have (codecs of contents, drawers) leaves out the others:
//
//     #define SKIP(name, Name)
//     #define CODEC(name, Name) {#name, &name##Codec()},
//     const Row kCodecs[] = {TESSERA_REPRESENTATIONS(SKIP, CODEC)};
#pragma once

// clang-format off
#define TESSERA_REPRESENTATIONS(TRAINED, SCENE) \
  TRAINED(field, Field)                         \
  SCENE(volume, Volume)                         \
  SCENE(hash, Hash)
// clang-format on
