// The table of all methods, in the order of list.h.
#pragma once

#include "train/method.h"

namespace tessera {

std::span<const Method* const> methods();

// Null when there is none of that name.
const Method* findMethod(std::string_view name);

// The method of the trained model in a folder. Throws Error when there is no manifest (which is no trained model), or
// when its method is none that this program has.
const Method& methodOf(const ModelFolder& model);
const Method& methodOf(const ModelFolder& model, const ModelManifest& manifest);

// The settings of the run that `model` holds; the defaults when it holds none.
std::unique_ptr<MethodSettings> savedSettings(const Method& method, const fs::path& model);

// The first that has it; CHECKs that there is one.
const Method& firstMethod(bool (*has)(const Method&));
// "volume and hash", of those that have it, in order.
std::string namesOfMethods(bool (*have)(const Method&), std::string_view conjunction = "and");

inline bool isBaked(const Method& method) {
  return method.openBaker != nullptr;
}

}  // namespace tessera
