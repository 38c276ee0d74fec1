#include "apps/tessera/folder_kind.h"

#include "import/capture_reader.h"
#include "import/importer.h"

namespace tessera {

FolderKind kindOfFolder(const fs::path& folder) {
  if (fs::exists(folder / "blocks.json")) return FolderKind::model;
  if (fs::exists(folder / "tileset.json")) return FolderKind::scene;
  if (isCapture(folder)) return FolderKind::capture;
  return sourceFormat(folder).empty() ? FolderKind::other : FolderKind::source;
}

}  // namespace tessera
