// Base class of the payload writers of ray-marched representations. Only codecs include this header, because it exposes
// JSON.
#pragma once

#include <span>
#include <vector>

#include "raymarch/content/content_part.h"
#include "raymarch/content/texel_pictures.h"
#include "tiles/content.h"
#include "tiles/content_file.h"
#include "tiles/writer_limits.h"

namespace tessera {

class ContentWriter {
 protected:
  using Json = nlohmann::ordered_json;

  explicit ContentWriter(int effort) : effort_(effort) {}

  static Json place(const ContentPart& part);
  // Returns the JSON that states which macroblocks are stored, and how many, for a part that has `texels` texels along
  // an axis. Indices are not stored but implied by the order of positions, so that none can be wrong: the macroblocks
  // must be written in that order (inOrder).
  Json macroblocks(const ContentPart& part, uint32_t texels, uint32_t stored);
  // Returns the macroblocks, of `bytesOfBlock` bytes each, in the order of their positions.
  static std::vector<uint8_t> inOrder(const ContentPart& part, std::span<const uint8_t> blocks, size_t bytesOfBlock);
  Json pictures(const TexelPictures& three);
  Json picture(const ImageU8& image);

  ContentFileWriter file_;

 private:
  int effort_;
};

}  // namespace tessera
