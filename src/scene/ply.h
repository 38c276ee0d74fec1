// Point clouds as PLY: positions, colours and reprojection errors of structure-from-motion points.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// ASCII or binary little-endian PLY. Reads x, y, z, colours (red, green, blue; floating ones are taken as 0..1), and
// error when it is there; skips other properties and elements. Nothing, and why in `reason`, when the bytes are not
// such a file or end early. Positions may be not-a-number if the file says so.
std::optional<std::vector<SparsePoint>> decodePly(std::span<const std::byte> bytes, std::string* reason = nullptr);
std::vector<SparsePoint> readPly(const fs::path& path);  // throws Error

// Binary little-endian: double x, y, z; uchar red, green, blue; float error. Exact for what decodePly reads back.
Bytes encodePly(std::span<const SparsePoint> points);

}  // namespace tessera
