#include "base/image_io.h"

// jpeglib.h needs <cstdio> before it.
// clang-format off
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <jpeglib.h>
// clang-format on

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <spng.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>

#include "base/error.h"
#include "base/random.h"

namespace tessera {
namespace {

ImageU8 smoothPicture(int width, int height, int channels) {
  ImageU8 image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        image.at(x, y)[c] = static_cast<uint8_t>(c == 0 ? 255 * x / width : c == 1 ? 255 * y / height : 40 * c);
      }
    }
  }
  return image;
}

ImageU8 noisePicture(int width, int height, int channels) {
  ImageU8 image(width, height, channels);
  const RandomStream random(4, 2);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = static_cast<uint8_t>(random.below(i, 256));
  return image;
}

double meanDifference(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

// Encodes a PNG of any colour type, bit depth and interlacing, including those that encodePng never writes. `data`
// contains the rows as PNG stores them (16-bit samples in the machine's byte order).
Bytes rawPng(spng_ihdr header, const std::vector<uint8_t>& data, const spng_plte* palette = nullptr,
             const spng_trns* transparency = nullptr) {
  spng_ctx* codec = spng_ctx_new(SPNG_CTX_ENCODER);
  spng_set_option(codec, SPNG_ENCODE_TO_BUFFER, 1);
  EXPECT_EQ(spng_set_ihdr(codec, &header), 0);
  if (palette) {
    spng_plte copy = *palette;
    EXPECT_EQ(spng_set_plte(codec, &copy), 0);
  }
  if (transparency) {
    spng_trns copy = *transparency;
    EXPECT_EQ(spng_set_trns(codec, &copy), 0);
  }
  EXPECT_EQ(spng_encode_image(codec, data.data(), data.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE), 0);
  size_t size = 0;
  int status = 0;
  void* buffer = spng_get_png_buffer(codec, &size, &status);
  const auto* start = static_cast<std::byte*>(buffer);
  Bytes bytes(start, start + size);
  std::free(buffer);
  spng_ctx_free(codec);
  return bytes;
}

spng_ihdr pngHeader(uint32_t width, uint32_t height, uint8_t depth, uint8_t type, uint8_t interlace = 0) {
  spng_ihdr header{};
  header.width = width;
  header.height = height;
  header.bit_depth = depth;
  header.color_type = type;
  header.interlace_method = interlace;
  return header;
}

Bytes cmykJpeg(const std::array<uint8_t, 4>& ink, int side) {
  jpeg_compress_struct codec;
  jpeg_error_mgr errors;
  codec.err = jpeg_std_error(&errors);
  jpeg_create_compress(&codec);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&codec, &buffer, &size);
  codec.image_width = codec.image_height = static_cast<JDIMENSION>(side);
  codec.input_components = 4;
  codec.in_color_space = JCS_CMYK;
  jpeg_set_defaults(&codec);  // writes the Adobe marker
  jpeg_set_quality(&codec, 100, TRUE);
  jpeg_start_compress(&codec, TRUE);
  std::vector<uint8_t> row;
  for (int i = 0; i < side; ++i) row.insert(row.end(), ink.begin(), ink.end());
  JSAMPROW line = row.data();
  for (int y = 0; y < side; ++y) jpeg_write_scanlines(&codec, &line, 1);
  jpeg_finish_compress(&codec);
  jpeg_destroy_compress(&codec);
  const auto* start = reinterpret_cast<std::byte*>(buffer);
  Bytes bytes(start, start + size);
  std::free(buffer);
  return bytes;
}

Bytes shortened(Bytes bytes, double share) {
  bytes.resize(static_cast<size_t>(static_cast<double>(bytes.size()) * share));
  return bytes;
}

TEST(ImageIo, PngIsLosslessForEveryChannelCount) {
  for (const int channels : {1, 3, 4}) {
    const ImageU8 image = noisePicture(31, 17, channels);
    const Bytes bytes = encodePng(image);
    const auto decoded = decodeImage(bytes);
    ASSERT_TRUE(decoded);
    EXPECT_FALSE(decoded->truncated);
    EXPECT_EQ(decoded->image.channels, channels);
    EXPECT_EQ(decoded->image.pixels, image.pixels);
    const auto info = probeImage(bytes);
    ASSERT_TRUE(info);
    EXPECT_EQ(info->width, 31);
    EXPECT_EQ(info->height, 17);
    EXPECT_EQ(info->channels, channels);
    EXPECT_EQ(info->format, ImageInfo::Format::png);
  }
}

TEST(ImageIo, ReadsBackJpegWithASmallError) {
  for (const int channels : {1, 3}) {
    const ImageU8 image = smoothPicture(50, 40, channels);
    const Bytes bytes = encodeJpeg(image, 95);
    const auto decoded = decodeImage(bytes);
    ASSERT_TRUE(decoded);
    EXPECT_FALSE(decoded->truncated);
    ASSERT_EQ(decoded->image.pixels.size(), image.pixels.size());
    EXPECT_LT(meanDifference(decoded->image, image), 2.0);
    const auto info = probeImage(bytes);
    ASSERT_TRUE(info);
    EXPECT_EQ(info->width, 50);
    EXPECT_EQ(info->height, 40);
    EXPECT_EQ(info->channels, channels);
  }
}

TEST(ImageIo, JpegCarriesExifWithOrWithoutItsName) {
  Bytes exif(40, std::byte{7});
  Bytes named(46, std::byte{7});
  std::memcpy(named.data(), "Exif\0\0", 6);
  const Bytes plain = encodeJpeg(smoothPicture(8, 8, 3), 90, exif);
  EXPECT_EQ(plain, encodeJpeg(smoothPicture(8, 8, 3), 90, named));
  EXPECT_NE(std::search(plain.begin(), plain.end(), named.begin(), named.end()), plain.end());
  EXPECT_TRUE(decodeImage(plain));
}

TEST(ImageIo, ProbesAJpegWhoseSizeFollowsLargeSegments) {
  const Bytes bytes = encodeJpeg(smoothPicture(8, 9, 3), 90, Bytes(65000));
  EXPECT_FALSE(probeImage(std::span(bytes).first(60000)));
  EXPECT_EQ(probeImage(bytes)->height, 9);
  const fs::path path = fs::temp_directory_path() / ("tessera_probe_" + std::to_string(::getpid()) + ".jpg");
  // Two segments: the second application segment starts where the first ends.
  Bytes longer(bytes.begin(), bytes.begin() + 2 + 18);
  const auto segment = std::span(bytes).subspan(20, 65000 + 10);
  for (int i = 0; i < 3; ++i) longer.insert(longer.end(), segment.begin(), segment.end());
  longer.insert(longer.end(), bytes.begin() + 20 + 65010, bytes.end());
  writeFileAtomically(path, longer);
  EXPECT_EQ(probeImageFile(path).height, 9);
  fs::remove(path);
}

TEST(ImageIo, TruncatedJpegIsDecodedAsFarAsItGoesAndSaysSo) {
  const ImageU8 image = noisePicture(64, 64, 3);
  const auto decoded = decodeImage(shortened(encodeJpeg(image, 95), 0.5));
  ASSERT_TRUE(decoded);
  EXPECT_TRUE(decoded->truncated);
  EXPECT_EQ(decoded->image.height, 64);
  const auto whole = decodeImage(encodeJpeg(image, 95));
  const size_t quarter = image.pixels.size() / 4;
  EXPECT_TRUE(std::equal(whole->image.pixels.begin(),
                         whole->image.pixels.begin() + static_cast<std::ptrdiff_t>(quarter),
                         decoded->image.pixels.begin()));
  EXPECT_FALSE(decodeImage(shortened(encodeJpeg(image, 95), 0.02)));  // not even a header
}

TEST(ImageIo, TruncatedPngIsDecodedAsFarAsItGoesAndFilledWithGrey) {
  const ImageU8 image = noisePicture(128, 128, 3);
  const auto decoded = decodeImage(shortened(encodePng(image), 0.5));
  ASSERT_TRUE(decoded);
  EXPECT_TRUE(decoded->truncated);
  EXPECT_TRUE(std::equal(image.pixels.begin(), image.pixels.begin() + 128 * 3 * 40, decoded->image.pixels.begin()));
  EXPECT_EQ(decoded->image.at(127, 127)[1], 128);
}

TEST(ImageIo, ConvertsCmykToRgb) {
  // In Adobe's convention 255 is no ink. This is full cyan and no other ink.
  const auto cyan = decodeImage(cmykJpeg({0, 255, 255, 255}, 16));
  ASSERT_TRUE(cyan);
  ASSERT_EQ(cyan->image.channels, 3);
  EXPECT_NEAR(cyan->image.at(8, 8)[0], 0, 3);
  EXPECT_NEAR(cyan->image.at(8, 8)[1], 255, 3);
  EXPECT_NEAR(cyan->image.at(8, 8)[2], 255, 3);
  const auto halfBlack = decodeImage(cmykJpeg({255, 255, 255, 128}, 16));
  EXPECT_NEAR(halfBlack->image.at(3, 3)[1], 128, 3);
}

TEST(ImageIo, ConvertsPalettesToColours) {
  spng_plte palette{};
  palette.n_entries = 2;
  palette.entries[0] = {10, 20, 30, 255};
  palette.entries[1] = {200, 100, 50, 255};
  const spng_ihdr header = pngHeader(3, 2, 1, SPNG_COLOR_TYPE_INDEXED);
  const auto decoded = decodeImage(rawPng(header, {0b01000000, 0b10100000}, &palette));
  ASSERT_TRUE(decoded);
  ASSERT_EQ(decoded->image.channels, 3);
  EXPECT_EQ(decoded->image.at(1, 0)[0], 200);
  EXPECT_EQ(decoded->image.at(2, 0)[2], 30);
  EXPECT_EQ(decoded->image.at(2, 1)[1], 100);

  spng_trns transparency{};
  transparency.n_type3_entries = 1;
  transparency.type3_alpha[0] = 77;
  const auto withAlpha = decodeImage(rawPng(header, {0b01000000, 0b10100000}, &palette, &transparency));
  ASSERT_TRUE(withAlpha);
  ASSERT_EQ(withAlpha->image.channels, 4);
  EXPECT_EQ(withAlpha->image.at(0, 0)[3], 77);
  EXPECT_EQ(withAlpha->image.at(1, 0)[3], 255);
}

TEST(ImageIo, ConvertsSixteenBitAndOneBitImagesToBytes) {
  const uint16_t deep[2] = {0xffff, 0x8000};
  std::vector<uint8_t> raw(4);
  std::memcpy(raw.data(), deep, 4);
  const auto grey = decodeImage(rawPng(pngHeader(2, 1, 16, SPNG_COLOR_TYPE_GRAYSCALE), raw));
  ASSERT_TRUE(grey);
  EXPECT_EQ(grey->image.pixels, (std::vector<uint8_t>{255, 128}));
  const auto bits = decodeImage(rawPng(pngHeader(3, 1, 1, SPNG_COLOR_TYPE_GRAYSCALE), {0b10100000}));
  ASSERT_TRUE(bits);
  EXPECT_EQ(bits->image.pixels, (std::vector<uint8_t>{255, 0, 255}));
  const uint16_t colour[3] = {0xffff, 0, 0x8080};
  std::vector<uint8_t> rawColour(6);
  std::memcpy(rawColour.data(), colour, 6);
  const auto rgb = decodeImage(rawPng(pngHeader(1, 1, 16, SPNG_COLOR_TYPE_TRUECOLOR), rawColour));
  ASSERT_TRUE(rgb);
  EXPECT_EQ(rgb->image.pixels, (std::vector<uint8_t>{255, 0, 128}));
  const auto greyAlpha = decodeImage(rawPng(pngHeader(1, 1, 8, SPNG_COLOR_TYPE_GRAYSCALE_ALPHA), {90, 200}));
  ASSERT_TRUE(greyAlpha);
  EXPECT_EQ(greyAlpha->image.pixels, (std::vector<uint8_t>{90, 90, 90, 200}));
}

TEST(ImageIo, DecodesInterlacedImages) {
  const ImageU8 image = noisePicture(13, 11, 3);
  for (const uint8_t interlace : {0, 1}) {
    const Bytes bytes = rawPng(pngHeader(13, 11, 8, SPNG_COLOR_TYPE_TRUECOLOR, interlace), image.pixels);
    const auto decoded = decodeImage(bytes);
    ASSERT_TRUE(decoded);
    EXPECT_FALSE(decoded->truncated);
    EXPECT_EQ(decoded->image.pixels, image.pixels) << int{interlace};
  }
}

TEST(ImageIo, RejectsImplausibleSizesBeforeAllocating) {
  Bytes png = encodePng(noisePicture(4, 4, 3));
  // The header claims 60000 × 60000 pixels.
  png = rawPng(pngHeader(4, 4, 8, SPNG_COLOR_TYPE_TRUECOLOR), noisePicture(4, 4, 3).pixels);
  const auto patched = [](Bytes bytes, size_t at, std::initializer_list<int> values) {
    for (const int value : values) bytes[at++] = static_cast<std::byte>(value);
    return bytes;
  };
  EXPECT_FALSE(decodeImage(patched(png, 16, {0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60})));
  const Bytes jpeg = encodeJpeg(smoothPicture(8, 8, 3));
  const unsigned char frame[2] = {0xff, 0xc0};
  const auto marker = std::search(jpeg.begin(), jpeg.end(), reinterpret_cast<const std::byte*>(frame),
                                  reinterpret_cast<const std::byte*>(frame) + 2);
  const size_t at = static_cast<size_t>(marker - jpeg.begin()) + 5;
  const Bytes absurd = patched(jpeg, at, {0xff, 0x00, 0xff, 0x00});
  EXPECT_EQ(probeImage(absurd)->width, 0xff00);
  EXPECT_FALSE(decodeImage(absurd));
  DecodeLimits tight;
  tight.maxPixels = 63;
  EXPECT_FALSE(decodeImage(jpeg, tight));
  tight.maxPixels = 64;
  EXPECT_TRUE(decodeImage(jpeg, tight));
}

TEST(ImageIo, SurvivesEveryTruncationAndManyFlippedBits) {
  ImageF depth(9, 7, 1, 2.5f);
  const std::vector<Bytes> files = {encodePng(noisePicture(12, 9, 4)), encodeJpeg(smoothPicture(24, 17, 3)),
                                    encodeDepthExr(depth),
                                    rawPng(pngHeader(13, 11, 8, 0, 1), noisePicture(13, 11, 1).pixels)};
  DecodeLimits limits;
  limits.maxPixels = 1 << 16;
  const RandomStream random(11, 0);
  for (const Bytes& file : files) {
    for (size_t length = 0; length < file.size(); ++length) {
      const auto cut = std::span(file).first(length);
      probeImage(cut);
      EXPECT_FALSE(decodeDepth(cut, 1.0f, limits) && length < 40);
      const auto image = decodeImage(cut, limits);
      // An image that is cut before its closing marker or chunk is reported as truncated.
      EXPECT_FALSE(image && length + 40 < file.size() && !image->truncated) << length;
    }
    for (uint64_t round = 0; round < 300; ++round) {
      Bytes damaged = file;
      for (uint64_t k = 0; k < 3; ++k) {
        damaged[random.below(round * 6 + 2 * k, static_cast<uint32_t>(file.size()))] ^=
            static_cast<std::byte>(1u << random.below(round * 6 + 2 * k + 1, 8));
      }
      probeImage(damaged);
      decodeImage(damaged, limits);
      decodeDepth(damaged, 1.0f, limits);
    }
  }
}

TEST(ImageIo, DepthExrKeepsEveryFloat) {
  ImageF depth(19, 33, 1);
  for (size_t i = 0; i < depth.pixels.size(); ++i) depth.pixels[i] = 0.1f * static_cast<float>(i);
  depth.pixels[5] = std::numeric_limits<float>::infinity();
  const Bytes bytes = encodeDepthExr(depth);
  const auto decoded = decodeDepth(bytes);
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->width, 19);
  EXPECT_EQ(decoded->pixels, depth.pixels);
  const auto info = probeImage(bytes);
  ASSERT_TRUE(info);
  EXPECT_EQ(info->width, 19);
  EXPECT_EQ(info->height, 33);
  EXPECT_EQ(info->channels, 1);
  EXPECT_EQ(info->format, ImageInfo::Format::exr);
  EXPECT_FALSE(decodeImage(bytes));
  EXPECT_FALSE(decodeDepth(shortened(bytes, 0.7)));
}

TEST(ImageIo, DepthIsFoundAmongOtherChannelsAndAttributes) {
  const fs::path path = fs::temp_directory_path() / ("tessera_channels_" + std::to_string(::getpid()) + ".exr");
  std::vector<half> colour(6 * 5, half(0.25f));
  std::vector<float> depth(6 * 5);
  for (size_t i = 0; i < depth.size(); ++i) depth[i] = 1.5f * static_cast<float>(i);
  for (const bool hasZ : {true, false}) {
    Imf::Header header(6, 5);
    header.compression() = Imf::PIZ_COMPRESSION;
    header.insert("comments", Imf::StringAttribute("made by a renderer that likes to talk"));
    header.insert("zebra", Imf::StringAttribute("behind all others"));
    Imf::FrameBuffer source;
    for (const char* name : {"A", "R"}) {
      header.channels().insert(name, Imf::Channel(Imf::HALF));
      source.insert(name,
                    Imf::Slice(Imf::HALF, reinterpret_cast<char*>(colour.data()), sizeof(half), sizeof(half) * 6));
    }
    if (hasZ) {
      header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
      source.insert("Z",
                    Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(depth.data()), sizeof(float), sizeof(float) * 6));
    }
    {
      Imf::OutputFile file(path.c_str(), header);
      file.setFrameBuffer(source);
      file.writePixels(5);
    }
    const auto decoded = decodeDepth(readFile(path));
    ASSERT_TRUE(decoded);
    EXPECT_EQ(decoded->pixels, hasZ ? depth : std::vector<float>(30, 0.25f));  // "R" where there is no "Z"
    EXPECT_EQ(probeImageFile(path).channels, hasZ ? 3 : 2);
  }
  fs::remove(path);
}

TEST(ImageIo, ExrAttributesWithFalseLengthsAreRefused) {
  const Bytes bytes = encodeDepthExr(ImageF(4, 4, 1, 1.0f));
  for (const char* text :
       {"channels\0chlist", "compression\0compression", "dataWindow\0box2i", "lineOrder\0lineOrder"}) {
    std::string record(text);  // up to the first zero
    record += std::string(1, '\0') + (text + record.size() + 1);
    const auto* start = reinterpret_cast<const std::byte*>(record.data());
    const auto match = std::search(bytes.begin(), bytes.end(), start, start + record.size());
    ASSERT_NE(match, bytes.end()) << text;
    for (const int change : {-1, 1, 2}) {
      Bytes damaged = bytes;
      std::byte& length = damaged[static_cast<size_t>(match - bytes.begin()) + record.size() + 1];
      length = static_cast<std::byte>(static_cast<int>(length) + change);
      EXPECT_FALSE(decodeDepth(damaged)) << text << change;
    }
  }
}

TEST(ImageIo, DepthPngIsAnIntegerTimesItsUnit) {
  const uint16_t steps[3] = {0, 1, 65535};
  std::vector<uint8_t> raw(6);
  std::memcpy(raw.data(), steps, 6);
  const Bytes bytes = rawPng(pngHeader(3, 1, 16, SPNG_COLOR_TYPE_GRAYSCALE), raw);
  const auto depth = decodeDepth(bytes, 0.001f);
  ASSERT_TRUE(depth);
  EXPECT_EQ(depth->pixels, (std::vector<float>{0.0f, 0.001f, 65.535f}));
  const Bytes narrow = encodePng(ImageU8(2, 1, 1, 7));
  EXPECT_EQ(decodeDepth(narrow, 2.0f)->pixels[1], 14.0f);
  EXPECT_FALSE(decodeDepth(encodePng(ImageU8(2, 1, 3, 7)), 1.0f));  // a colour image is not a depth map
  EXPECT_FALSE(decodeDepth(shortened(bytes, 0.75), 1.0f));
}

TEST(ImageIo, FilesAreWrittenAndReadByContentAndErrorsNameThem) {
  const fs::path folder = fs::temp_directory_path() / ("tessera_image_io_" + std::to_string(::getpid()));
  const ImageU8 image = noisePicture(5, 6, 3);
  writePng(folder / "really_png.jpg", image);
  EXPECT_EQ(readImage(folder / "really_png.jpg").image.pixels, image.pixels);
  EXPECT_EQ(probeImageFile(folder / "really_png.jpg").height, 6);
  writeJpeg(folder / "b.jpg", image);
  EXPECT_EQ(readImage(folder / "b.jpg").image.width, 5);
  writeDepthExr(folder / "c.exr", ImageF(2, 2, 1, 3.0f));
  EXPECT_EQ(readDepth(folder / "c.exr").pixels[3], 3.0f);
  writeFileAtomically(folder / "d.png", std::string_view("not a picture"));
  for (const char* name : {"d.png", "absent.png"}) {
    for (const auto& attempt : {std::function<void()>([&] { readImage(folder / name); }),
                                std::function<void()>([&] { readDepth(folder / name); }),
                                std::function<void()>([&] { probeImageFile(folder / name); })}) {
      try {
        attempt();
        FAIL() << "no error for " << name;
      } catch (const Error& error) {
        EXPECT_EQ(error.subject(), (folder / name).string());
      }
    }
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace tessera
