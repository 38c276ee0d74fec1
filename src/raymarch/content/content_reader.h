// What the readers of payloads of parts have in common: parts of the extension and of the buffer views, untrusted. For
// codecs, not for their users: it shows JSON.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "raymarch/content/content_part.h"
#include "raymarch/content/texel_pictures.h"
#include "tiles/content.h"
#include "tiles/content_file.h"
#include "tiles/network_payload.h"

namespace tessera {

class ContentReader {
 protected:
  ContentReader(const ContentFile& file, std::string& reason, const ContentLimits& limits)
      : file_(file), reason_(reason), limits_(limits) {}

  // False; the first reason counts.
  bool fail(const std::string& reason);

  const nlohmann::json* networkField() const;  // null where there is none
  // The parts' array, if there are not too many.
  const nlohmann::json* partsOf();
  static bool readPlace(const nlohmann::json& source, ContentPart& part);
  // How many macroblocks a part says that it has.
  static std::optional<uint32_t> storedOf(const nlohmann::json& source);

  // The macroblocks of a part of `texels` along an axis. Where there are any, `take(pictures, size)` is to read them.
  using TakePictures = std::function<bool(const nlohmann::json& pictures, const PictureSize& size)>;
  bool readMacroblocks(const nlohmann::json& source, uint32_t texels, uint32_t stored, ContentPart& part,
                       const TakePictures& take);
  // Three pictures of texels, one after the other: take(picture, which).
  using TakePicture = std::function<bool(const ImageU8& picture, size_t which)>;
  bool takePictures(const nlohmann::json& source, const PictureSize& size, const TakePicture& take);
  bool readBits(const nlohmann::json& source, const char* key, OccupancyBits& bits);

  const ContentFile& file_;
  std::string& reason_;
  const ContentLimits& limits_;

 private:
  std::optional<ImageU8> readPicture(const nlohmann::json& source, const PictureSize& size);
};

// The way through the content of one representation. PartHeader is what a part says of itself, before anything is
// allocated for it: `part`, without bytes, and bytes() that it will take. Reader, a class derived from this one, has
//   bool readSettings()                    of the content
//   bool readHeader(source, header)        false where it is not complete
//   bool readPictures(source, header, what)   into the part; `what` it is that is being read
template <class Reader, class Content, class PartHeader>
class PartsReader : protected ContentReader {
 public:
  PartsReader(const ContentFile& file, std::string& reason, const ContentLimits& limits)
      : ContentReader(file, reason, limits) {}

  std::optional<Content> read() {
    if (!self().readSettings() || !readNetworkLayers() ||
        !readLayerNumbers(file_, *networkField(), content_.network, reason_) || !readHeaders()) {
      return std::nullopt;
    }
    for (size_t i = 0; i < headers_.size(); ++i) {
      const char* what = "";
      if (!self().readPictures(*sources_[i], headers_[i], what)) {
        fail(fmt::format("part {}: its {} are not what they should be", i, what));
        return std::nullopt;
      }
      content_.parts.push_back(std::move(headers_[i].part));
    }
    if (auto broken = brokenRule(content_)) {
      fail(*broken);
      return std::nullopt;
    }
    return std::move(content_);
  }

  // What it takes in memory; looks at no buffer view.
  std::optional<uint64_t> readBytes() {
    if (!self().readSettings() || !readNetworkLayers() || !readHeaders()) return std::nullopt;
    uint64_t bytes = bytesInMemory(content_);
    for (const DenseLayer& layer : content_.network) {
      bytes += sizeof(float) * (uint64_t{layer.inputs} * layer.outputs + layer.outputs);
    }
    for (const PartHeader& header : headers_) bytes += header.bytes();
    return bytes;
  }

 protected:
  Content content_;

 private:
  Reader& self() { return static_cast<Reader&>(*this); }
  bool readNetworkLayers() { return readLayers(networkField(), content_.network, reason_); }

  bool readHeaders() {
    const nlohmann::json* parts = partsOf();
    if (!parts) return false;
    uint64_t bytes = 0;
    for (const nlohmann::json& source : *parts) {
      PartHeader header;
      if (!self().readHeader(source, header)) {
        return fail(fmt::format("part {}: its header is not complete", headers_.size()));
      }
      bytes += header.bytes();
      if (bytes > limits_.bytes) return fail(fmt::format("takes more than {} bytes of memory", limits_.bytes));
      headers_.push_back(std::move(header));
      sources_.push_back(&source);
    }
    return true;
  }

  std::vector<PartHeader> headers_;
  std::vector<const nlohmann::json*> sources_;
};

}  // namespace tessera
