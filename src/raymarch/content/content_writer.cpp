#include "raymarch/content/content_writer.h"

#include <bit>

#include "tiles/lossless_image.h"

namespace tessera {

ContentWriter::Json ContentWriter::place(const ContentPart& part) {
  return {{"centre", part.centre},
          {"scale", part.scale},
          {"contracted", part.contracted},
          {"background_block", part.backgroundBlock},
          {"low", part.low},
          {"high", part.high}};
}

ContentWriter::Json ContentWriter::macroblocks(const ContentPart& part, uint32_t texels, uint32_t stored) {
  OccupancyBits alive(texels / ContentPart::kMacroblock);
  for (size_t place = 0; place < part.macroblocks.size(); ++place) {
    if (part.macroblocks[place] != ContentPart::kEmpty) alive.set(place);
  }
  return {{"stored", stored}, {"alive", picture(pictureOfBits(alive))}};
}

std::vector<uint8_t> ContentWriter::inOrder(const ContentPart& part, std::span<const uint8_t> blocks,
                                            size_t bytesOfBlock) {
  std::vector<uint8_t> ordered;
  ordered.reserve(blocks.size());
  for (const uint32_t number : part.macroblocks) {
    if (number == ContentPart::kEmpty) continue;
    const auto block = blocks.subspan(number * bytesOfBlock, bytesOfBlock);
    ordered.insert(ordered.end(), block.begin(), block.end());
  }
  return ordered;
}

ContentWriter::Json ContentWriter::pictures(const TexelPictures& three) {
  Json json = Json::array();
  for (const ImageU8& one : three) json.push_back(picture(one));
  return json;
}

ContentWriter::Json ContentWriter::picture(const ImageU8& image) {
  return file_.add(encodeLossless(image, effort_), kWebP);
}

}  // namespace tessera
