#include "raymarch/content/content_reader.h"

#include <bit>

#include "tiles/json_fields.h"
#include "tiles/lossless_image.h"

namespace tessera {

using namespace json_fields;

namespace {

bool takeTriple(const json& object, const char* key, std::array<float, 3>& triple) {
  const auto numbers = getNumbers<3>(object, key);
  if (!numbers) return false;
  for (size_t a = 0; a < 3; ++a) triple[a] = static_cast<float>((*numbers)[a]);
  return true;
}

}  // namespace

bool ContentReader::fail(const std::string& reason) {
  if (reason_.empty()) reason_ = reason;
  return false;
}

const json* ContentReader::networkField() const {
  return getField(file_.ours, "network");
}

const json* ContentReader::readPartSources() {
  const json* parts = getArray(file_.ours, "parts");
  if (parts && !parts->empty() && parts->size() <= limits_.parts) return parts;
  fail("has no parts, or too many");
  return nullptr;
}

bool ContentReader::readPlace(const json& source, ContentPart& part) {
  const auto contracted = getBoolean(source, "contracted"), backgroundBlock = getBoolean(source, "background_block");
  if (!contracted || !backgroundBlock) return false;
  part.contracted = *contracted;
  part.backgroundBlock = *backgroundBlock;
  return takeTriple(source, "centre", part.centre) && takeTriple(source, "scale", part.scale) &&
         takeTriple(source, "low", part.low) && takeTriple(source, "high", part.high);
}

std::optional<uint32_t> ContentReader::readStoredCount(const json& source) {
  const json* macroblocks = getField(source, "macroblocks");
  return macroblocks ? getUnsigned(*macroblocks, "stored", kMaxStored) : std::nullopt;
}

bool ContentReader::readMacroblocks(const json& part, uint32_t texels, uint32_t stored, ContentPart& into,
                                    const TakePictures& take) {
  const json& source = *getField(part, "macroblocks");
  OccupancyBits alive(texels / ContentPart::kMacroblock);
  if (!readBits(source, "alive", alive)) return false;
  uint32_t count = 0;
  for (const uint64_t word : alive.words) count += static_cast<uint32_t>(std::popcount(word));
  if (count != stored) return false;
  into.macroblocks.resize(alive.count());
  uint32_t number = 0;
  for (size_t place = 0; place < alive.count(); ++place) {
    into.macroblocks[place] = alive.at(place) ? number++ : ContentPart::kEmpty;
  }
  if (stored == 0) return true;
  const json* pictures = getField(source, "texels");
  return pictures && take(*pictures, sizeOfMacroblocks(stored));
}

bool ContentReader::takePictures(const json& source, const PictureSize& size, const TakePicture& take) {
  if (!source.is_array() || source.size() != kTexelPictures) return false;
  for (size_t which = 0; which < kTexelPictures; ++which) {
    const auto picture = readPicture(source[which], size);
    if (!picture || !take(*picture, which)) return false;
  }
  return true;
}

bool ContentReader::readBits(const json& source, const char* key, OccupancyBits& bits) {
  const json* entry = getField(source, key);
  const auto picture = entry ? readPicture(*entry, sizeOfBits(bits.count())) : std::nullopt;
  return picture && takeBits(*picture, bits);
}

std::optional<ImageU8> ContentReader::readPicture(const json& source, const PictureSize& size) {
  const auto bytes = file_.bufferViewBytes(source, kWebP);
  if (!bytes) return std::nullopt;
  return decodeLossless(*bytes, static_cast<int>(size.width), static_cast<int>(size.height));
}

}  // namespace tessera
