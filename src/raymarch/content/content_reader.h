// Base classes of the payload readers of ray-marched representations. They read the parts from a content's glTF
// extension and its buffer views, both of which are untrusted. Only codecs include this header, because it exposes
// JSON.
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

  // Returns false. Only the first reason is reported.
  bool fail(const std::string& reason);

  const nlohmann::json* networkField() const;  // null if there is none
  // Returns the array of parts; null, after fail(), if it is empty or larger than the limits allow.
  const nlohmann::json* readPartSources();
  // Reads centre, scale, box and flags. Returns false if one of them is missing or has the wrong type.
  static bool readPlace(const nlohmann::json& source, ContentPart& part);
  // Returns the number of stored macroblocks that a part declares.
  static std::optional<uint32_t> readStoredCount(const nlohmann::json& source);

  // Reads the macroblock indices of a part that has `texels` texels along an axis. If macroblocks are stored, their
  // texels are read by `take(pictures, size)`. Returns false if the number of occupied macroblocks is not `stored`, or
  // anything is malformed.
  using TakePictures = std::function<bool(const nlohmann::json& pictures, const PictureSize& size)>;
  bool readMacroblocks(const nlohmann::json& source, uint32_t texels, uint32_t stored, ContentPart& part,
                       const TakePictures& take);
  // Decodes the three pictures of a set of texels and passes them on one after another: take(picture, which).
  using TakePicture = std::function<bool(const ImageU8& picture, size_t which)>;
  bool takePictures(const nlohmann::json& source, const PictureSize& size, const TakePicture& take);
  // Reads the picture of bits under `key` into `bits`, whose size is already set.
  bool readBits(const nlohmann::json& source, const char* key, OccupancyBits& bits);

  const ContentFile& file_;
  std::string& reason_;
  const ContentLimits& limits_;

 private:
  std::optional<ImageU8> readPicture(const nlohmann::json& source, const PictureSize& size);
};

// Reads the content of one representation. PartHeader is what a part declares of itself, read before anything is
// allocated for it: `part`, without texels, and bytes(), the memory that the part will take. Reader, which derives from
// this class, has
//   bool readSettings()                      reads the settings of the content
//   bool readHeader(source, header)          returns false if the header is not complete
//   bool readPictures(source, header, what)  reads texels into the part; `what` names what is being read, for errors
template <class Reader, class Content, class PartHeader>
class PartsReader : protected ContentReader {
 public:
  PartsReader(const ContentFile& file, std::string& reason, const ContentLimits& limits)
      : ContentReader(file, reason, limits) {}

  // Returns the content, or nothing after fail().
  std::optional<Content> read() {
    if (!self().readSettings() || !readNetworkLayers() ||
        !readLayerNumbers(file_, *networkField(), content_.network, reason_) || !readHeaders()) {
      return std::nullopt;
    }
    for (size_t i = 0; i < headers_.size(); ++i) {
      const char* what = "";
      if (!self().readPictures(*sources_[i], headers_[i], what)) {
        fail(fmt::format("part {}: its {} are malformed", i, what));
        return std::nullopt;
      }
      content_.parts.push_back(std::move(headers_[i].part));
    }
    if (auto broken = validationError(content_)) {
      fail(*broken);
      return std::nullopt;
    }
    return std::move(content_);
  }

  // Returns the memory in bytes that the content will take. Reads the JSON alone, no buffer view.
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
    const nlohmann::json* parts = readPartSources();
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
