// What the readers of every representation's payload have in common: parts of the extension and of the buffer views,
// untrusted. For this room's own files: it shows JSON.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tiles/content.h"
#include "tiles/content_file.h"
#include "tiles/texel_pictures.h"

namespace tessera {

class ContentReader {
 protected:
  ContentReader(const ContentFile& file, std::string& reason, const ContentLimits& limits)
      : file_(file), reason_(reason), limits_(limits) {}

  // False; the first reason counts.
  bool fail(const std::string& reason);

  // What the layers are to hold, and their numbers.
  bool readLayers(std::vector<DenseLayer>& network);
  bool readNetwork(std::vector<DenseLayer>& network);

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
  bool readPictures(const nlohmann::json& source, const PictureSize& size, const TakePicture& take);
  bool readBits(const nlohmann::json& source, const char* key, OccupancyBits& bits);

  const ContentFile& file_;
  std::string& reason_;
  const ContentLimits& limits_;

 private:
  std::optional<ImageU8> readPicture(const nlohmann::json& source, const PictureSize& size);
};

}  // namespace tessera
