#include "tiles/read_content.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "tiles/content_file.h"
#include "tiles/content_rules.h"
#include "tiles/glb.h"
#include "tiles/hash_payload.h"
#include "tiles/volume_payload.h"

namespace tessera {
namespace {

Error noContent(const fs::path& path, const std::string& reason) {
  return {path.string(), "", reason, "copy the scene again, or bake it again"};
}

template <class Content>
struct Payload;

template <>
struct Payload<VolumeContent> {
  static constexpr Representation kRepresentation = Representation::volume;
  static constexpr auto kDecode = decodeVolume;
  static constexpr auto kDecodedBytes = decodedVolumeBytes;
};

template <>
struct Payload<HashContent> {
  static constexpr Representation kRepresentation = Representation::hash;
  static constexpr auto kDecode = decodeHash;
  static constexpr auto kDecodedBytes = decodedHashBytes;
};

}  // namespace

template <class Content>
Content readContent(const fs::path& path, const ContentLimits& limits) {
  std::string reason;
  auto content = Payload<Content>::kDecode(readFile(path, limits.fileBytes), reason, limits);
  if (!content) throw noContent(path, reason);
  return std::move(*content);
}

template <class Content>
Content readPromisedContent(const fs::path& path, size_t tile, const TileContent& promised) {
  Content content = readContent<Content>(path);
  for (size_t i = 0; i < content.parts.size(); ++i) {
    if (const auto broken = brokenPromise(content.parts[i], i, promised)) {
      throw Error(path.string(), fmt::format("of tile {} in tileset.json", tile), *broken,
                  "copy the scene again, or bake it again");
    }
  }
  return content;
}

template <class Content>
uint64_t readDecodedBytes(const fs::path& path, const ContentLimits& limits) {
  std::error_code status;
  const auto length = jsonLengthOf(readFileStart(path, kGlbStart), fs::file_size(path, status));
  if (!length) throw noContent(path, kNoGlb);
  // A byte more than is allowed is enough to see that it is too much.
  const Bytes start = readFileStart(path, kGlbStart + std::min<uint64_t>(*length, kMostContentJson + 1));
  const std::string_view text(reinterpret_cast<const char*>(start.data()), start.size());
  std::string reason;
  const auto bytes = Payload<Content>::kDecodedBytes(text.substr(std::min(kGlbStart, text.size())), reason, limits);
  if (!bytes) throw noContent(path, reason);
  return *bytes;
}

uint64_t readDecodedBytes(const fs::path& path, Representation representation) {
  switch (representation) {
    case Representation::volume:
      return readDecodedBytes<VolumeContent>(path);
    case Representation::hash:
      return readDecodedBytes<HashContent>(path);
    case Representation::mesh:
      break;
  }
  throw noContent(path, "is of a representation that is not known yet");
}

template <class Content>
Representation representationOf() {
  return Payload<Content>::kRepresentation;
}

template VolumeContent readContent(const fs::path&, const ContentLimits&);
template HashContent readContent(const fs::path&, const ContentLimits&);
template VolumeContent readPromisedContent(const fs::path&, size_t, const TileContent&);
template HashContent readPromisedContent(const fs::path&, size_t, const TileContent&);
template uint64_t readDecodedBytes<VolumeContent>(const fs::path&, const ContentLimits&);
template uint64_t readDecodedBytes<HashContent>(const fs::path&, const ContentLimits&);
template Representation representationOf<VolumeContent>();
template Representation representationOf<HashContent>();

}  // namespace tessera
