// Where the models of a world find their files: embedded in the world, or on disk. They are looked up as in the browser
// (web/src/app/models/model-files.ts), but of letters only those of ASCII match in either case.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "world/world_file.h"

namespace tessera {

// Returns a path with '/' between its parts and without parts that cancel one another.
std::string plainPath(const std::string& path);

// Files by their paths.
class FileIndex {
 public:
  struct Entry {
    std::string path;
    const Bytes* embedded = nullptr;  // null: the file is on disk, or missing
  };
  void add(const std::string& name, const Bytes* embedded);
  // Returns the files of this path, with letters of the same case first, then those of the same name in any folder.
  std::vector<const Entry*> findAlike(const std::string& name) const;
  // The extension, such as .mtl, may be in upper or lower case.
  static bool hasExtension(const std::string& path, const std::string& lowerExtension);
  // Returns the files with this extension.
  std::vector<const Entry*> withExtension(const std::string& lowerExtension) const;
  // Returns the embedded file of this path; null if there is none.
  const Bytes* findEmbedded(const std::string& name) const;

 private:
  // The path, the path in lower case, the name in lower case.
  static std::array<std::string, 3> keys(const std::string& path);

  std::vector<Entry> entries_;
  std::array<std::map<std::string, std::vector<size_t>>, 3> numbers_;  // of entries, by key
};

// Returns the embedded files of a world, to which the result refers.
FileIndex indexEmbedded(const World& world);

// The files of one model.
class ModelFiles {
 public:
  // Keeps a reference to `embedded`. `folder`: of the world. `maxBytes`: of a file on disk.
  ModelFiles(const FileIndex& embedded, const WorldModel& model, const fs::path& folder, uint64_t maxBytes);

  // Returns the content of a file that the model names by a path, which is relative to the folder of the world: among
  // the files that the world lists for the model, or else among all embedded ones, that of this path, or else the first
  // of this name in any folder. A file that is none of these must lie in the folder of the world: models come from
  // anywhere. The path is looked up as it is, and then with %20 and the like decoded. If there is a single material
  // library (.mtl) among the listed and embedded files, it stands for any that is not there.
  std::optional<Bytes> read(const std::string& path);
  // Throws Error if read() was asked for a file that is too large.
  void requireSmallFiles() const;

 private:
  std::optional<Bytes> readFirst(const std::vector<const FileIndex::Entry*>& entries);
  std::optional<Bytes> readOnlyLibrary();
  std::optional<Bytes> readDisk(const fs::path& file);

  const FileIndex& embedded_;
  FileIndex listed_;
  fs::path folder_;
  uint64_t maxBytes_;
  std::optional<fs::path> tooLarge_;
};

}  // namespace tessera
