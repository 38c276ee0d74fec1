// The table of all methods, in the order of list.h.
#pragma once

#include "train/method.h"

namespace tessera {

std::span<const Method* const> methods();

// Returns the method with that name, or null if there is none.
const Method* findMethod(std::string_view name);

// Returns the method of the trained model in a folder. Throws Error if there is no manifest (the folder then holds no
// trained model), or if this program does not know the manifest's method.
const Method& findModelMethod(const ModelFolder& model);
const Method& findModelMethod(const ModelFolder& model, const ModelManifest& manifest);

// Returns the settings that the training run in the folder `model` saved; the method's defaults if there are none.
std::unique_ptr<MethodSettings> savedSettings(const Method& method, const fs::path& model);

// Returns Method::readCoverage of a trained model; nothing for methods that do not check it.
std::vector<SurfaceCoverage> readCoverage(const Method& method, const fs::path& model);

// Returns the first method that satisfies the predicate `has`; CHECKs that there is one.
const Method& firstMethod(bool (*has)(const Method&));
// Returns the names of the methods that satisfy the predicate `have`, in the order of list.h, as text: "volume and
// hash".
std::string namesOfMethods(bool (*have)(const Method&), std::string_view conjunction = "and");

inline bool isBaked(const Method& method) {
  return method.openBaker != nullptr;
}

}  // namespace tessera
