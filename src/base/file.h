// Reads and writes whole files (writes are atomic: a temporary file is renamed), and resolves paths that must not leave
// their folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

namespace fs = std::filesystem;
using Bytes = std::vector<std::byte>;

// Returns the whole file. Throws Error naming the path if it cannot be read or is larger than `maxBytes`; in the latter
// case no memory is allocated for it.
Bytes readFile(const fs::path& path, uint64_t maxBytes = UINT64_MAX);
std::string readTextFile(const fs::path& path, uint64_t maxBytes = UINT64_MAX);
// Returns the first `bytes` bytes of the file, or all of them where it has fewer. Throws Error naming the path if it
// cannot be read.
Bytes readFileStart(const fs::path& path, uint64_t bytes);

// Whether so little is free on the disk of `path` that a program which failed may have failed for that.
bool isNearlyFull(const fs::path& path);

// Writes `path` + ".partial-<pid>" and renames it over `path`, so that a reader sees either the old file or the new
// one, never a part, even if the process is killed. With `durable` the bytes reach the disk before the rename. Missing
// parent folders are created. Where `path` is a pipe or a device, the bytes are written to it directly. Throws Error
// naming the path if it cannot be written.
void writeFileAtomically(const fs::path& path, std::span<const std::byte> bytes, bool durable = false);
void writeFileAtomically(const fs::path& path, std::string_view text, bool durable = false);

// Returns `root / relative` if the result stays inside `root` (no absolute path, no `..` or symbolic link that leads
// out of it); otherwise nothing. The file need not exist.
std::optional<fs::path> resolveInside(const fs::path& root, std::string_view relative);

// Compares file names in natural order: frame_2 comes before frame_10.
bool naturalLess(std::string_view a, std::string_view b);

}  // namespace tessera
