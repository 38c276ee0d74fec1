#include "representations/codecs.h"

#include <fmt/format.h>

#include "base/error.h"
#include "representations/list.h"

namespace tessera {

#define SKIP(name, Name)
#define CODEC(name, Name) const ContentCodec& name##Codec();
TESSERA_REPRESENTATIONS(SKIP, CODEC)
#undef CODEC

const ContentCodec* findCodec(std::string_view representation) {
#define CODEC(name, Name) \
  if (representation == #name) return &name##Codec();
  TESSERA_REPRESENTATIONS(SKIP, CODEC)
#undef CODEC
  return nullptr;
}

const ContentCodec& requireCodec(const fs::path& folder, const Tileset& tileset) {
  const ContentCodec* codec = findCodec(tileset.representation);
  if (codec) return *codec;
  throw Error((folder / "tileset.json").string(), "representation",
              fmt::format("the scene has the unknown representation {}", tileset.representation),
              "restore the file, or use a newer tessera");
}

}  // namespace tessera
