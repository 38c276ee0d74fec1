#include "export/glb_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "base/check.h"
#include "base/error.h"
#include "base/leftovers.h"
#include "tiles/glb.h"

namespace tessera {
namespace {

constexpr uint64_t kSpaceForJson = uint64_t{1} << 28;  // bytes of the largest file that are kept for its JSON

}  // namespace

GlbFile::GlbFile(fs::path place) : place_(std::move(place)) {
  std::error_code status;
  if (fs::is_directory(place_, status))
    throw Error(place_.string(), "", "is a folder, not a file", "name a file to write, or remove the folder");
  if (place_.has_parent_path()) fs::create_directories(place_.parent_path(), status);
  // Of a symbolic link, what it leads to is replaced.
  if (const fs::path led = fs::canonical(place_, status); !status) place_ = led;
  removeLeftovers(place_);
  spool_ = beside_ = partialPlace(place_);
  spool_ += kSpooled;
  out_.open(spool_, std::ios::binary | std::ios::trunc);
  if (!out_) fail();
}

GlbFile::~GlbFile() {
  out_.close();
  std::error_code ignored;
  fs::remove(spool_, ignored);
  fs::remove(beside_, ignored);
}

size_t GlbFile::addView(std::span<const std::byte> bytes, uint32_t target) {
  CHECK(!bytes.empty());
  if (bytes_ + bytes.size() > kLargestGlb - kSpaceForJson) {
    throw Error(place_.string(), "", "would be larger than the 4 GiB that binary glTF allows",
                "export with --split, or a coarser level with --level");
  }
  views_.push_back({{"buffer", 0}, {"byteOffset", bytes_}, {"byteLength", bytes.size()}});
  if (target != 0) views_.back()["target"] = target;
  static constexpr std::array<char, 3> kPadding{};
  const size_t padding = (4 - bytes.size() % 4) % 4;
  out_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  out_.write(kPadding.data(), static_cast<std::streamsize>(padding));
  if (!out_) fail();
  bytes_ += bytes.size() + padding;
  return views_.size() - 1;
}

uint64_t GlbFile::commit(GltfScene::Json asset) {
  CHECK(!views_.empty());
  out_.close();
  if (!out_) fail();
  asset["buffers"] = {{{"byteLength", bytes_}}};
  asset["bufferViews"] = std::move(views_);
  const std::string text = asset.dump();
  if (text.size() > kSpaceForJson - kGlbStart - 16) {
    throw Error(place_.string(), "", "would be larger than the 4 GiB that binary glTF allows", "export with --split");
  }
  const Bytes start = encodeGlbStart(text, bytes_);
  std::ofstream to(beside_, std::ios::binary | std::ios::trunc);
  to.write(reinterpret_cast<const char*>(start.data()), static_cast<std::streamsize>(start.size()));
  std::ifstream from(spool_, std::ios::binary);
  to << from.rdbuf();
  to.close();
  std::error_code status;
  if (!to || !from || fs::file_size(beside_, status) != start.size() + bytes_) fail();
  fs::rename(beside_, place_, status);
  if (status) fail();
  fs::remove(spool_, status);
  return start.size() + bytes_;
}

void GlbFile::fail() const {
  throw Error(place_.string(), "", std::string("could not be written: ") + std::strerror(errno),
              "check free space and permissions");
}

}  // namespace tessera
