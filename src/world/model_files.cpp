#include "world/model_files.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr const char* kLibrary = ".mtl";

}  // namespace

std::string plainPath(const std::string& path) {
  std::string plain = path;
  std::replace(plain.begin(), plain.end(), '\\', '/');
  return fs::path(plain).lexically_normal().generic_string();
}

std::array<std::string, 3> FileIndex::keys(const std::string& path) {
  std::string lower = path;
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return {path, lower, lower.substr(lower.rfind('/') + 1)};
}

void FileIndex::add(const std::string& name, const Bytes* embedded) {
  const std::string path = plainPath(name);
  const std::array<std::string, 3> all = keys(path);
  for (size_t k = 0; k < all.size(); ++k) numbers_[k][all[k]].push_back(entries_.size());
  entries_.push_back({path, embedded});
}

std::vector<const FileIndex::Entry*> FileIndex::findAlike(const std::string& name) const {
  std::vector<const Entry*> alike;
  const std::array<std::string, 3> all = keys(plainPath(name));
  for (size_t k = 0; k < all.size(); ++k) {
    const auto known = numbers_[k].find(all[k]);
    if (known == numbers_[k].end()) continue;
    for (const size_t number : known->second) alike.push_back(&entries_[number]);
  }
  return alike;
}

bool FileIndex::hasExtension(const std::string& path, const std::string& lowerExtension) {
  return keys(path)[2].ends_with(lowerExtension);
}

std::vector<const FileIndex::Entry*> FileIndex::withExtension(const std::string& lowerExtension) const {
  std::vector<const Entry*> all;
  for (const Entry& entry : entries_)
    if (hasExtension(entry.path, lowerExtension)) all.push_back(&entry);
  return all;
}

const Bytes* FileIndex::findEmbedded(const std::string& name) const {
  const std::array<std::string, 3> all = keys(plainPath(name));
  for (size_t k = 0; k < 2; ++k)
    if (const auto known = numbers_[k].find(all[k]); known != numbers_[k].end()) {
      return entries_[known->second.front()].embedded;
    }
  return nullptr;
}

FileIndex indexEmbedded(const World& world) {
  FileIndex index;
  for (const auto& [name, bytes] : world.files) index.add(name, &bytes);
  return index;
}

ModelFiles::ModelFiles(const FileIndex& embedded, const WorldModel& model, const fs::path& folder, uint64_t maxBytes)
    : embedded_(embedded), folder_(folder), maxBytes_(maxBytes) {
  for (const std::string& name : model.files) {
    if (!isOfNetwork(name)) listed_.add(name, embedded.findEmbedded(name));
  }
}

std::optional<Bytes> ModelFiles::read(const std::string& path) {
  const std::string names[] = {path, decodePercent(path)};
  for (const std::string& name : names) {
    if (auto bytes = readFirst(listed_.findAlike(name))) return bytes;
    if (auto bytes = readFirst(embedded_.findAlike(name))) return bytes;
  }
  for (const std::string& name : names) {
    const std::optional<fs::path> inside = resolveInside(folder_, plainPath(name));
    if (!inside) continue;
    if (auto bytes = readDisk(*inside)) return bytes;
  }
  return FileIndex::hasExtension(path, kLibrary) ? readOnlyLibrary() : std::nullopt;
}

void ModelFiles::requireSmallFiles() const {
  if (!tooLarge_) return;
  throw Error(tooLarge_->string(), "", fmt::format("is larger than {} MiB", maxBytes_ >> 20),
              "export the model with fewer triangles, or smaller textures");
}

std::optional<Bytes> ModelFiles::readOnlyLibrary() {
  std::vector<const FileIndex::Entry*> all = listed_.withExtension(kLibrary);
  for (const FileIndex::Entry* entry : embedded_.withExtension(kLibrary)) {
    const auto isSame = [&](const FileIndex::Entry* listed) { return listed->embedded == entry->embedded; };
    if (std::none_of(all.begin(), all.end(), isSame)) all.push_back(entry);
  }
  return all.size() == 1 ? readFirst(all) : std::nullopt;
}

std::optional<Bytes> ModelFiles::readFirst(const std::vector<const FileIndex::Entry*>& entries) {
  for (const FileIndex::Entry* entry : entries) {
    if (entry->embedded != nullptr) return *entry->embedded;
    if (auto bytes = readDisk(folder_ / entry->path)) return bytes;
  }
  return std::nullopt;
}

std::optional<Bytes> ModelFiles::readDisk(const fs::path& file) {
  std::error_code status;
  if (!fs::is_regular_file(file, status)) return std::nullopt;
  if (fs::file_size(file, status) <= maxBytes_) return readFile(file, maxBytes_);
  tooLarge_ = file;
  return std::nullopt;
}

}  // namespace tessera
