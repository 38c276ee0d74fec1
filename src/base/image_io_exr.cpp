// Depth as EXR through OpenEXR, from and to memory. Its exceptions end here.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>

#include <cstring>
#include <stdexcept>
#include <string_view>

#include "base/check.h"
#include "base/image_codecs.h"

namespace tessera {
namespace {

constexpr uint32_t kDeepOrMultipart = 0x800 | 0x1000;

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

// A zero-terminated string at `at`, which moves behind it.
std::optional<std::string_view> takeString(std::span<const std::byte> bytes, size_t& at) {
  const auto* start = reinterpret_cast<const char*>(bytes.data()) + at;
  const size_t length = strnlen(start, bytes.size() - at);
  if (at + length >= bytes.size()) return std::nullopt;
  at += length + 1;
  return std::string_view(start, length);
}

}  // namespace

namespace image_codecs {

bool isExr(std::span<const std::byte> bytes) {
  return bytes.size() >= 8 && littleEndian32(bytes, 0) == 20000630;
}

// The header is walked here, before the library sees it: the library allocates by what it claims.
std::optional<ImageInfo> probeExr(std::span<const std::byte> bytes) {
  if (!isExr(bytes) || (littleEndian32(bytes, 4) & kDeepOrMultipart) != 0) return std::nullopt;
  ImageInfo info;
  info.format = ImageInfo::Format::exr;
  size_t at = 8;
  for (;;) {
    const auto name = takeString(bytes, at);
    if (!name) return std::nullopt;
    if (name->empty()) break;
    if (!takeString(bytes, at) || bytes.size() - at < 4) return std::nullopt;
    const size_t length = littleEndian32(bytes, at);
    at += 4;
    if (length > bytes.size() - at) return std::nullopt;
    if (*name == "dataWindow" && length == 16) {
      int64_t side[4];
      for (size_t i = 0; i < 4; ++i) side[i] = static_cast<int32_t>(littleEndian32(bytes, at + 4 * i));
      const int64_t width = side[2] - side[0] + 1, height = side[3] - side[1] + 1;
      if (width < 1 || height < 1 || width > INT32_MAX || height > INT32_MAX) return std::nullopt;
      info.width = static_cast<int>(width);
      info.height = static_cast<int>(height);
    } else if (*name == "channels") {
      info.channels = 0;
      const auto list = bytes.subspan(at, length);
      for (size_t i = 0; i < list.size();) {
        const auto channel = takeString(list, i);
        if (!channel || channel->empty()) break;
        ++info.channels;
        if (list.size() - i < 16) return std::nullopt;
        i += 16;
      }
    }
    at += length;
  }
  if (info.width == 0 || info.channels == 0) return std::nullopt;
  return info;
}

std::optional<ImageF> decodeExrDepth(std::span<const std::byte> bytes, const DecodeLimits& limits) {
  const auto info = probeExr(bytes);
  if (!info || !isPlausible(info->width, info->height, bytes.size(), limits)) return std::nullopt;
  try {
    MemoryInput stream(bytes);
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
