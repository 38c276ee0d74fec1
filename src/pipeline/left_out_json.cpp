#include "pipeline/left_out_json.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

void writeLeftOut(const fs::path& file, const std::vector<LeftOutPhoto>& photos) {
  Json json = Json::array();
  for (const LeftOutPhoto& photo : photos) json.push_back({{"photo", photo.name}, {"reason", photo.reason}});
  // Names of photos need not be UTF-8.
  writeFileAtomically(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

void addLeftOut(const fs::path& file, const std::set<std::string>& names, const std::string& reason) {
  std::error_code status;
  if (names.empty() || !fs::exists(file, status)) return;
  std::vector<LeftOutPhoto> photos = readLeftOut(file);
  for (const std::string& name : names) {
    const auto isIt = [&name](const LeftOutPhoto& photo) { return photo.name == name; };
    if (std::none_of(photos.begin(), photos.end(), isIt)) photos.push_back({name, reason});
  }
  writeLeftOut(file, photos);
}

std::vector<LeftOutPhoto> readLeftOut(const fs::path& file) {
  const Json json = Json::parse(readTextFile(file), nullptr, false);
  const Error damaged(file.string(), "", "does not list photos with reasons", "remove it, and run again");
  if (!json.is_array()) throw damaged;
  std::vector<LeftOutPhoto> photos;
  for (const Json& entry : json) {
    if (!entry.is_object()) throw damaged;
    const auto photo = entry.find("photo"), reason = entry.find("reason");
    if (photo == entry.end() || !photo->is_string() || reason == entry.end() || !reason->is_string()) throw damaged;
    photos.push_back({photo->get<std::string>(), reason->get<std::string>()});
  }
  return photos;
}

}  // namespace tessera
