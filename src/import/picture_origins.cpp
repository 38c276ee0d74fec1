#include "import/picture_origins.h"

#include <fmt/format.h>

#include "base/error.h"

namespace tessera {
namespace {

constexpr size_t kDigits = 16;

// Returns the FNV-1a hash in hexadecimal digits.
std::string hashText(const std::string& text) {
  uint64_t hash = 0xcbf29ce484222325ull;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  return fmt::format("{:016x}", hash);
}

std::map<std::string, std::string> readFingerprints(const fs::path& file) {
  std::map<std::string, std::string> fingerprints;
  std::error_code status;
  if (!fs::is_regular_file(file, status)) return fingerprints;
  const std::string text = readTextFile(file);
  for (size_t begin = 0; begin < text.size();) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string line = text.substr(begin, end - begin);
    if (line.size() > kDigits + 2) fingerprints[line.substr(kDigits + 2)] = line.substr(0, kDigits);
    begin = end + 1;
  }
  return fingerprints;
}

}  // namespace

std::string describeFile(const fs::path& file) {
  std::error_code status;
  const fs::path path = fs::weakly_canonical(file, status);
  const uintmax_t bytes = fs::file_size(file, status);
  const auto time = fs::last_write_time(file, status).time_since_epoch().count();
  return fmt::format("{}\n{}\n{}", path.string(), bytes, time);
}

void PictureOrigins::add(const std::string& picture, const fs::path& source, const std::string& how) {
  origins_[picture] = {source, hashText(describeFile(source) + "\n" + how)};
}

void PictureOrigins::requireOwn(const fs::path& capture) const {
  std::error_code status;
  if (fs::exists(capture / "sources.txt", status)) return;
  for (const auto& [picture, origin] : origins_) {
    const fs::path path = capture / picture;
    if (!fs::is_regular_file(path, status) || fs::equivalent(path, origin.source, status)) continue;
    throw Error(path.string(), "", "was not written by an import, and would be lost",
                "name another folder to write to");
  }
}

void PictureOrigins::claim(const fs::path& capture) const {
  const fs::path file = capture / "sources.txt";
  const auto known = readFingerprints(file);
  std::string text;
  for (const auto& [picture, origin] : origins_) {
    const auto entry = known.find(picture);
    const fs::path path = capture / picture;
    std::error_code status;
    // An image that is its own source (hard-linked, or imported in place) cannot be a copy of another source.
    if ((entry == known.end() || entry->second != origin.fingerprint) && fs::is_regular_file(path, status) &&
        !fs::equivalent(path, origin.source, status)) {
      fs::remove(path, status);
      if (status) {
        throw Error(path.string(), "", "is of another import and could not be removed: " + status.message(),
                    "name another folder to write to");
      }
    }
    if (picture.find('\n') == picture.npos) text += fmt::format("{}  {}\n", origin.fingerprint, picture);
  }
  writeFileAtomically(file, text);
}

}  // namespace tessera
