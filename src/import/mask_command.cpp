#include "import/mask_command.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "base/child_process.h"
#include "base/error.h"
#include "base/image_io.h"
#include "import/photo_files.h"

namespace tessera {
namespace {

constexpr const char* kPhoto = "{photo}";
constexpr const char* kMask = "{mask}";

[[noreturn]] void refuse(const std::string& text, const std::string& why, const std::string& remedy) {
  throw Error("--mask-command " + text, "", why, remedy);
}

std::vector<std::string> splitWords(const std::string& text) {
  std::vector<std::string> words;
  std::optional<std::string> word;
  char quote = 0;
  for (const char c : text) {
    if (quote != 0 ? c == quote : c == '\'' || c == '"') {
      quote = quote != 0 ? '\0' : c;
      if (!word) word.emplace();
    } else if (quote == 0 && (c == ' ' || c == '\t' || c == '\n')) {
      if (word) words.push_back(*std::exchange(word, std::nullopt));
    } else {
      if (!word) word.emplace();
      *word += c;
    }
  }
  if (quote != 0) refuse(text, "has a quotation mark without its counterpart", "close the quotation");
  if (word) words.push_back(*word);
  return words;
}

std::string replaceAll(std::string text, const std::string& what, const std::string& by) {
  for (size_t at = text.find(what); at != text.npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
  return text;
}

}  // namespace

MaskCommand::MaskCommand(const std::string& text) : text_(text), words_(splitWords(text)) {
  if (words_.empty() || words_[0].empty()) refuse(text, "names no program", "name the program that makes masks");
  const auto names = [&](const char* place) {
    return std::any_of(words_.begin(), words_.end(),
                       [&](const std::string& word) { return word.find(place) != word.npos; });
  };
  if (names(kPhoto) != names(kMask))
    refuse(text, "names only one of {photo} and {mask}", "name both, or none: then both paths are appended");
  if (!names(kPhoto)) words_.insert(words_.end(), {kPhoto, kMask});
}

void MaskCommand::makeMask(const fs::path& photo, const fs::path& target, const ImageU8& other) const {
  // Programs choose the format by the extension.
  const fs::path output = fs::absolute(target.parent_path() / (target.stem().string() + ".partial.png"));
  std::error_code status;
  fs::create_directories(target.parent_path(), status);
  fs::remove(output, status);
  const auto fail = [&](const std::string& why, const std::string& remedy) {
    fs::remove(output, status);
    throw Error(photo.string(), "", fmt::format("its mask: --mask-command {} {}", text_, why), remedy);
  };

  std::vector<std::string> arguments;
  for (const std::string& word : words_) {
    // A path that contains "{mask}" is left as it is.
    const size_t at = word.find(kPhoto);
    const auto withMask = [&](const std::string& part) { return replaceAll(part, kMask, output.string()); };
    arguments.push_back(at == word.npos ? withMask(word)
                                        : withMask(word.substr(0, at)) + fs::absolute(photo).string() +
                                              withMask(word.substr(at + std::string(kPhoto).size())));
  }
  ChildProcess process;
  const std::string failure = process.start(arguments);
  if (!failure.empty())
    fail("cannot be started: " + failure, "install the program, or name it by its path; it is not run by a shell");
  const std::string end = process.wait(), words = process.lastWords();
  if (!end.empty()) {
    fail(end + (words.empty() ? "" : ": " + words),
         "run it by itself with this photo, correct it, and import again: what is finished is not repeated");
  }
  if (!fs::is_regular_file(output, status)) {
    fail("wrote no mask" + (words.empty() ? "" : ": " + words),
         "it must write the path that {mask} stands for, its last argument if the command does not name it");
  }
  const auto decoded = decodeImage(readFile(output));
  if (!decoded || decoded->truncated) {
    fail("wrote a mask that cannot be decoded",
         "it must write a PNG: black where the photo is to be ignored, white elsewhere");
  }
  const ImageInfo expected = probeImageFile(photo);
  ImageU8 mask = toMask(decoded->image, false);
  if (mask.width != expected.width || mask.height != expected.height) {
    fail(fmt::format("wrote a mask of {} x {} pixels, and the photo has {} x {}", mask.width, mask.height,
                     expected.width, expected.height),
         "it must write masks of the size of the photo that it gets");
  }
  for (size_t i = 0; i < other.pixels.size(); ++i) mask.pixels[i] = std::min(mask.pixels[i], other.pixels[i]);
  fs::remove(output, status);
  writePng(target, mask);
}

}  // namespace tessera
