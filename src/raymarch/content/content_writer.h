// What the writers of payloads of parts have in common. For codecs, not for their users: it shows JSON.
#pragma once

#include <span>
#include <vector>

#include "base/error.h"
#include "raymarch/content/content_part.h"
#include "raymarch/content/texel_pictures.h"
#include "tiles/content.h"
#include "tiles/content_file.h"

namespace tessera {

class ContentWriter {
 protected:
  using Json = nlohmann::ordered_json;

  explicit ContentWriter(int effort) : effort_(effort) {}

  static Json place(const ContentPart& part);
  // Which macroblocks of a part of `texels` along an axis are stored, and how many. Their places say their numbers, so
  // that none can be wrong: they are to be written in the order of places (inOrder).
  Json macroblocks(const ContentPart& part, uint32_t texels, uint32_t stored);
  // Macroblocks of so many bytes each, in the order of their places.
  static std::vector<uint8_t> inOrder(const ContentPart& part, std::span<const uint8_t> blocks, size_t bytesOfBlock);
  Json pictures(const TexelPictures& three);
  Json picture(const ImageU8& image);

  ContentFileWriter file_;

 private:
  int effort_;
};

// For what settings can cause: a content that readers would refuse.

Error contentTooLarge(const std::string& why, const std::string& remedy);
// Throws it where there are more parts, or bytes of memory, than readers take.
void requireContentWithin(const ContentLimits& limits, size_t parts, uint64_t bytes, const std::string& remedy);
void requireFileWithin(const ContentLimits& limits, uint64_t bytes, const std::string& remedy);

}  // namespace tessera
