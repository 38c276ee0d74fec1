// Reads and writes point clouds as PLY: positions, colours and reprojection errors of structure-from-motion points.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// Decodes ASCII or binary little-endian PLY. Reads x, y, z, colours (red, green, blue; floating-point ones are in
// [0, 1]), and error if present; skips other properties and elements. Returns nothing, with the reason in `reason`, if
// the bytes are not such a file or end early. Positions may be NaN where the file contains NaN.
std::optional<std::vector<SparsePoint>> decodePly(std::span<const std::byte> bytes, std::string* reason = nullptr);
std::vector<SparsePoint> readPly(const fs::path& path);  // throws Error naming the file if it cannot be read or decoded

// Encodes as binary little-endian: double x, y, z; uchar red, green, blue; float error. decodePly reads it back
// exactly.
Bytes encodePly(std::span<const SparsePoint> points);

}  // namespace tessera
