// A program that makes masks at import, such as a network that finds cars and people.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

class MaskCommand {
 public:
  // `text`: a program and its arguments, separated by spaces; an argument with spaces is put into single or double
  // quotes. {photo} and {mask} stand for the paths of a photo and of the mask that the program is to write; without
  // them, both are appended. There is no shell: no other character has a meaning. Throws Error if it is malformed.
  explicit MaskCommand(const std::string& text);

  // Makes the mask of a photo of a capture, and writes it to `target`, with one channel of 0 or 255: white where the
  // program's mask is, and `other`, too, unless it is empty. Throws Error if the program fails or its mask cannot be
  // used; then no file remains.
  void makeMask(const fs::path& photo, const fs::path& target, const ImageU8& other) const;

 private:
  std::string text_;
  std::vector<std::string> words_;
};

}  // namespace tessera
