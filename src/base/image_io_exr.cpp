// Depth maps as EXR through OpenEXR, from and to memory. Exceptions of the library are caught here.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

#include <array>
#include <cstring>
#include <iterator>
#include <stdexcept>
#include <string_view>

#include "base/check.h"
#include "base/image_codecs.h"

namespace tessera {
namespace {

constexpr uint32_t kTiledDeepOrMultipart = 0x200 | 0x800 | 0x1000;  // unusual for depth maps, not decoded
constexpr int64_t kMaximumChunk = int64_t{256} << 20;
constexpr int kLinesPerChunk[] = {1, 1, 1, 16, 32, 16, 32, 32, 32, 256};  // by compression number

class MemoryInput : public Imf::IStream {
 public:
  explicit MemoryInput(std::span<const std::byte> bytes) : IStream("memory"), bytes_(bytes) {}

  bool read(char target[], int count) override {
    if (count < 0 || static_cast<size_t>(count) > bytes_.size() - position_) {
      throw std::runtime_error("unexpected end of data");
    }
    std::memcpy(target, bytes_.data() + position_, static_cast<size_t>(count));
    position_ += static_cast<size_t>(count);
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override {
    if (position > bytes_.size()) throw std::runtime_error("position beyond the end of data");
    position_ = position;
  }

 private:
  std::span<const std::byte> bytes_;
  size_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  MemoryOutput() : OStream("memory") {}

  void write(const char source[], int count) override {
    if (bytes.size() < position_ + static_cast<size_t>(count)) bytes.resize(position_ + static_cast<size_t>(count));
    std::memcpy(bytes.data() + position_, source, static_cast<size_t>(count));
    position_ += static_cast<size_t>(count);
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  Bytes bytes;

 private:
  size_t position_ = 0;
};

uint32_t littleEndian32(std::span<const std::byte> bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 4; i-- > 0;) value = value << 8 | static_cast<uint32_t>(bytes[at + i]);
  return value;
}

// Returns the zero-terminated string at `at`, and moves `at` past it.
std::optional<std::string_view> takeString(std::span<const std::byte> bytes, size_t& at) {
  if (at >= bytes.size()) return std::nullopt;
  const auto* start = reinterpret_cast<const char*>(bytes.data()) + at;
  const size_t length = strnlen(start, bytes.size() - at);
  if (at + length >= bytes.size()) return std::nullopt;
  at += length + 1;
  return std::string_view(start, length);
}

struct Attribute {
  const char* name;
  const char* type;
  size_t bytes;  // 0: any
};
// The attributes that decoding needs.
constexpr Attribute kNeeded[] = {{"channels", "chlist", 0},        {"compression", "compression", 1},
                                 {"dataWindow", "box2i", 16},      {"displayWindow", "box2i", 16},
                                 {"lineOrder", "lineOrder", 1},    {"pixelAspectRatio", "float", 4},
                                 {"screenWindowCenter", "v2f", 8}, {"screenWindowWidth", "float", 4}};
constexpr size_t kNeededCount = std::size(kNeeded);

struct Header {
  std::array<std::span<const std::byte>, kNeededCount> records;  // name, type, length and value, as in the file
  std::array<std::span<const std::byte>, kNeededCount> values;
  size_t length = 0;  // where the header ends
};

// Parses the header before the library does, because the library allocates whatever size an attribute claims.
std::optional<Header> walkHeader(std::span<const std::byte> bytes) {
  if (!image_codecs::isExr(bytes) || (littleEndian32(bytes, 4) & kTiledDeepOrMultipart) != 0) return std::nullopt;
  Header header;
  for (size_t at = 8;;) {
    const size_t start = at;
    const auto name = takeString(bytes, at);
    if (!name) return std::nullopt;
    if (name->empty()) {
      header.length = at;
      return header;
    }
    const auto type = takeString(bytes, at);
    if (!type || bytes.size() - at < 4) return std::nullopt;
    const size_t length = littleEndian32(bytes, at);
    at += 4;
    if (length > bytes.size() - at) return std::nullopt;
    for (size_t i = 0; i < kNeededCount; ++i) {
      if (*name != kNeeded[i].name) continue;
      const bool isRight = *type == kNeeded[i].type && (kNeeded[i].bytes == 0 || kNeeded[i].bytes == length);
      if (!isRight || !header.records[i].empty()) return std::nullopt;
      header.records[i] = bytes.subspan(start, at - start + length);
      header.values[i] = bytes.subspan(at, length);
    }
    at += length;
  }
}

// Returns the number of channels in the list, or nothing if it does not end exactly where it should.
std::optional<int> channelCount(std::span<const std::byte> list) {
  int count = 0;
  for (size_t at = 0;;) {
    const auto name = takeString(list, at);
    if (!name) return std::nullopt;
    if (name->empty()) return at == list.size() ? std::optional(count) : std::nullopt;
    if (list.size() - at < 16) return std::nullopt;
    at += 16;
    ++count;
  }
}

std::optional<ImageInfo> infoFrom(const Header& header) {
  const auto channels = channelCount(header.values[0]);
  const auto& window = header.values[2];
  if (!channels || *channels < 1 || window.empty()) return std::nullopt;
  int64_t side[4];
  for (size_t i = 0; i < 4; ++i) side[i] = static_cast<int32_t>(littleEndian32(window, 4 * i));
  const int64_t width = side[2] - side[0] + 1, height = side[3] - side[1] + 1;
  if (width < 1 || height < 1 || width > INT32_MAX || height > INT32_MAX) return std::nullopt;
  return ImageInfo{static_cast<int>(width), static_cast<int>(height), *channels, ImageInfo::Format::exr};
}

// Returns the file with only the needed attributes in its header. One string attribute replaces all others and keeps
// the header's length, because the offsets after the header count from the start of the file.
std::optional<Bytes> reducedFile(std::span<const std::byte> bytes, const Header& header) {
  static constexpr char kFiller[] = "filler\0string";  // with its final zero
  Bytes file(bytes.begin(), bytes.begin() + 8);
  for (const auto& record : header.records) {
    if (record.empty()) return std::nullopt;
    file.insert(file.end(), record.begin(), record.end());
  }
  const size_t left = header.length - 1 - file.size();
  if (left > 0) {
    if (left < sizeof kFiller + 4) return std::nullopt;
    const size_t length = left - sizeof kFiller - 4;
    const auto* start = reinterpret_cast<const std::byte*>(kFiller);
    file.insert(file.end(), start, start + sizeof kFiller);
    for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::byte>(length >> (8 * i)));
    file.insert(file.end(), length, std::byte{' '});
  }
  file.insert(file.end(), bytes.begin() + static_cast<std::ptrdiff_t>(header.length - 1), bytes.end());
  return file;
}

}  // namespace

namespace image_codecs {

bool isExr(std::span<const std::byte> bytes) {
  return bytes.size() >= 8 && littleEndian32(bytes, 0) == 20000630;
}

std::optional<ImageInfo> probeExr(std::span<const std::byte> bytes) {
  const auto header = walkHeader(bytes);
  return header ? infoFrom(*header) : std::nullopt;
}

std::optional<ImageF> decodeExrDepth(std::span<const std::byte> bytes, const DecodeLimits& limits) {
  const auto header = walkHeader(bytes);
  const auto info = header ? infoFrom(*header) : std::nullopt;
  if (!info || !isPlausible(info->width, info->height, bytes.size(), limits)) return std::nullopt;
  const auto reduced = reducedFile(bytes, *header);
  if (!reduced) return std::nullopt;
  const auto compression = static_cast<size_t>(header->values[1][0]);
  if (compression >= std::size(kLinesPerChunk)) return std::nullopt;
  if (int64_t{4} * info->width * info->channels > kMaximumChunk / kLinesPerChunk[compression]) return std::nullopt;
  try {
    MemoryInput stream(*reduced);
    Imf::InputFile file(stream, 0);
    const Imf::ChannelList& channels = file.header().channels();
    const char* chosen = nullptr;
    int count = 0;
    for (auto it = channels.begin(); it != channels.end(); ++it) ++count;
    if (channels.findChannel("Z") != nullptr) {
      chosen = "Z";
    } else if (channels.findChannel("R") != nullptr) {
      chosen = "R";
    } else if (count == 1) {
      chosen = channels.begin().name();
    }
    if (chosen == nullptr) return std::nullopt;
    if (channels[chosen].xSampling != 1 || channels[chosen].ySampling != 1) return std::nullopt;
    const auto window = file.header().dataWindow();
    if (window.max.x - int64_t{window.min.x} + 1 != info->width ||
        window.max.y - int64_t{window.min.y} + 1 != info->height) {
      return std::nullopt;
    }
    ImageF depth(info->width, info->height, 1);
    Imf::FrameBuffer target;
    target.insert(chosen, Imf::Slice::Make(Imf::FLOAT, depth.pixels.data(), window, sizeof(float),
                                           sizeof(float) * static_cast<size_t>(info->width)));
    file.setFrameBuffer(target);
    file.readPixels(window.min.y, window.max.y);
    return depth;
  } catch (const std::exception&) {
    return std::nullopt;
  }
}

}  // namespace image_codecs

Bytes encodeDepthExr(const ImageF& depth) {
  CHECK(depth.channels == 1);
  CHECK(!depth.empty());
  Imf::Header header(depth.width, depth.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
  MemoryOutput stream;
  {
    Imf::OutputFile file(stream, header, 0);
    Imf::FrameBuffer source;
    source.insert("Z", Imf::Slice::Make(Imf::FLOAT, depth.pixels.data(), header.dataWindow(), sizeof(float),
                                        sizeof(float) * static_cast<size_t>(depth.width)));
    file.setFrameBuffer(source);
    file.writePixels(depth.height);
  }
  return std::move(stream.bytes);
}

}  // namespace tessera
