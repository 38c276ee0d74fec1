#include "raymarch/content/content_writer.h"

#include <fmt/format.h>

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

Error contentTooLarge(const std::string& why, const std::string& remedy) {
  return {"a content that was to be written", "", why, remedy};
}

void requireContentWithin(const ContentLimits& limits, size_t parts, uint64_t bytes, const std::string& remedy) {
  if (parts > limits.parts) {
    throw contentTooLarge(fmt::format("merges {} blocks, and readers take {} at most", parts, limits.parts), remedy);
  }
  if (bytes > limits.bytes) {
    throw contentTooLarge(fmt::format("takes {} bytes of memory, and readers take {} at most", bytes, limits.bytes),
                          remedy);
  }
}

void requireFileWithin(const ContentLimits& limits, uint64_t bytes, const std::string& remedy) {
  if (bytes > limits.fileBytes) {
    throw contentTooLarge(fmt::format("takes {} bytes on disk, and readers take {} at most", bytes, limits.fileBytes),
                          remedy);
  }
}

}  // namespace tessera
