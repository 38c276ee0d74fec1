#include "representations/mesh/train/listed_folder.h"

#include <nlohmann/json.hpp>

namespace tessera {

void ListedFolder::writeFile(const std::string& name, const Bytes& bytes) const {
  writeFileAtomically(file(name), bytes, true);
}

void ListedFolder::writeList(const nlohmann::json& list) const {
  writeFileAtomically(pathOfList(), nlohmann::json({{list_, list}}).dump(2) + "\n", true);
}

bool ListedFolder::isComplete() const {
  return fs::exists(pathOfList());
}

nlohmann::json ListedFolder::readList() const {
  const nlohmann::json json = nlohmann::json::parse(readTextFile(pathOfList()), nullptr, false);
  if (!json.is_object() || !json.contains(list_)) throw malformed("is missing");
  return json[list_];
}

Error ListedFolder::malformed(const std::string& what) const {
  return Error(pathOfList().string(), list_, what, "remove the file, and resume the training");
}

void ListedFolder::remove() const {
  if (!isComplete()) return;
  fs::remove(pathOfList());
  fs::remove_all(folder_);
}

}  // namespace tessera
