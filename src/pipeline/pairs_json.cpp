#include "pipeline/pairs_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

void writePairs(const fs::path& file, const ChosenPairs& chosen) {
  const Json json = {{"photos", chosen.photos}, {"pairs", chosen.pairs}, {"look_alikes", chosen.lookAlikes}};
  writeFileAtomically(file, json.dump());
}

ChosenPairs readPairs(const fs::path& file, size_t photos) {
  const Json json = Json::parse(readTextFile(file), nullptr, false);
  const Error damaged(file.string(), "", "does not describe pairs of these photos", "run again with --from pairs");
  const auto isPhoto = [photos](const Json& number) {
    return number.is_number_unsigned() && number.get<uint64_t>() < photos;
  };
  const auto isList = [&](const Json& list) {
    return list.is_array() && std::all_of(list.begin(), list.end(), isPhoto);
  };
  const auto hasLists = [&](const char* key) {
    return json.is_object() && json.contains(key) && json[key].is_array() &&
           std::all_of(json[key].begin(), json[key].end(), isList);
  };
  if (!hasLists("pairs") || !hasLists("look_alikes")) throw damaged;
  ChosenPairs chosen;
  if (json.contains("photos") && json["photos"].is_string()) chosen.photos = json["photos"].get<std::string>();
  for (const Json& pair : json["pairs"]) {
    if (pair.size() != 2 || pair[0] >= pair[1]) throw damaged;
    chosen.pairs.emplace_back(pair[0].get<int>(), pair[1].get<int>());
  }
  chosen.lookAlikes = json["look_alikes"].get<LookAlikes>();
  if (!chosen.lookAlikes.empty() && chosen.lookAlikes.size() != photos) throw damaged;
  return chosen;
}

}  // namespace tessera
