// Files as whole byte strings, written beside and renamed, and paths that cannot leave their folder.
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

// The whole file. Throws Error naming the path when it cannot be read, or is larger than `mostBytes`: no memory is
// taken for it then.
Bytes readFile(const fs::path& path, uint64_t mostBytes = UINT64_MAX);
std::string readTextFile(const fs::path& path, uint64_t mostBytes = UINT64_MAX);
// Its first bytes: all where it has fewer. Throws Error likewise.
Bytes readFileStart(const fs::path& path, uint64_t bytes);

// Writes `path` + ".partial-<pid>" and renames it over `path`, so that a reader (or a kill) sees the old file or the
// new one, never a piece. With `durable` the bytes reach the disk before the rename. Parent folders are made. What is
// there and no file, a pipe or a device, is written to and stays what it is.
void writeFileAtomically(const fs::path& path, std::span<const std::byte> bytes, bool durable = false);
void writeFileAtomically(const fs::path& path, std::string_view text, bool durable = false);

// `root / relative` when the result stays inside `root` (no absolute paths, no `..` that climbs out, no symbolic link
// that leads out); otherwise nothing. The file need not exist.
std::optional<fs::path> resolveInside(const fs::path& root, std::string_view relative);

// File names in the order people expect: frame_2 before frame_10.
bool naturalLess(std::string_view a, std::string_view b);

}  // namespace tessera
