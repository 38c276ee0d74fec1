// A folder of the files that one stage of a training makes, and a list of them that is written last: who finds the list
// finds all files. A stage that was killed leaves no list, and is repeated.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "base/error.h"
#include "base/file.h"

namespace tessera {

class ListedFolder {
 public:
  // The list is the file `<list>.json`, with one member, `list`.
  ListedFolder(fs::path folder, std::string list) : folder_(std::move(folder)), list_(std::move(list)) {}

  const fs::path& path() const { return folder_; }
  fs::path file(const std::string& name) const { return folder_ / name; }
  // Writes one file. Other processes may write the same at the same time. Throws Error if it cannot be written.
  void writeFile(const std::string& name, const Bytes& bytes) const;
  void writeList(const nlohmann::json& list) const;

  bool isComplete() const;
  // Returns what writeList has written. Throws Error if the file does not have it.
  nlohmann::json readList() const;
  // Returns the error that the list is malformed: `what` says how.
  Error malformed(const std::string& what) const;
  // Removes a complete folder. If it is interrupted, the folder is not complete any more.
  void remove() const;

 private:
  fs::path pathOfList() const { return folder_ / (list_ + ".json"); }

  fs::path folder_;
  std::string list_;
};

}  // namespace tessera
