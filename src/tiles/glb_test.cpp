#include "tiles/glb.h"

#include <gtest/gtest.h>

#include <functional>

namespace tessera {
namespace {

Bytes bytesOfText(std::string_view text) {
  const auto raw = std::as_bytes(std::span(text.data(), text.size()));
  return Bytes(raw.begin(), raw.end());
}

void put(Bytes& file, size_t at, uint32_t value) {
  for (size_t i = 0; i < 4; ++i) file[at + i] = static_cast<std::byte>(value >> (8 * i));
}

TEST(Glb, RoundTripsEveryLength) {
  for (size_t length = 0; length < 9; ++length) {
    const std::string json = "{" + std::string(length, ' ') + "}";
    const Bytes content = bytesOfText(std::string(length, 'b'));
    const Bytes file = encodeGlb(json, content);
    EXPECT_EQ(file.size() % 4, 0u);
    const auto view = decodeGlb(file);
    ASSERT_TRUE(view);
    EXPECT_EQ(view->json.substr(0, json.size()), json);
    EXPECT_EQ(view->json.find_first_not_of(' ', json.size()), std::string_view::npos);
    EXPECT_EQ(view->json.size() % 4, 0u);
    ASSERT_EQ(view->bytes.size(), (length + 3) / 4 * 4);
    for (size_t i = 0; i < view->bytes.size(); ++i) EXPECT_EQ(view->bytes[i], std::byte(i < length ? 'b' : 0));
  }
}

TEST(Glb, IgnoresLaterChunksOfUnknownTypes) {
  Bytes file = encodeGlb("{}", bytesOfText("abcd"));
  const Bytes more = bytesOfText(std::string("\4\0\0\0WHATxxxx", 12));
  file.insert(file.end(), more.begin(), more.end());
  put(file, 8, static_cast<uint32_t>(file.size()));
  const auto view = decodeGlb(file);
  ASSERT_TRUE(view);
  EXPECT_EQ(view->bytes.size(), 4u);
}

TEST(Glb, RejectsEveryTruncation) {
  const Bytes file = encodeGlb("{\"a\":1}", bytesOfText("abcdefg"));
  for (size_t length = 0; length < file.size(); ++length) {
    EXPECT_FALSE(decodeGlb(std::span(file).first(length))) << length;
  }
}

TEST(Glb, RejectsHeadersThatAreNotExact) {
  // 12 bytes of header, JSON chunk at 12 with 4 bytes, BIN chunk at 24 with 8.
  const Bytes good = encodeGlb("{}", bytesOfText("abcdefgh"));
  ASSERT_TRUE(decodeGlb(good));
  ASSERT_EQ(good.size(), 40u);
  const auto refuses = [&](const char* what, const std::function<void(Bytes&)>& spoil) {
    Bytes file = good;
    spoil(file);
    EXPECT_FALSE(decodeGlb(file)) << what;
  };
  refuses("another magic", [](Bytes& file) { file[0] = std::byte('x'); });
  refuses("version 1", [](Bytes& file) { put(file, 4, 1); });
  refuses("a longer total", [](Bytes& file) { put(file, 8, 44); });
  refuses("a shorter total", [](Bytes& file) { put(file, 8, 36); });
  refuses("bytes after the end", [](Bytes& file) { file.resize(44); });
  refuses("a chunk beyond the end", [](Bytes& file) { put(file, 24, 12); });
  refuses("a chunk beyond 32 bits", [](Bytes& file) { put(file, 24, 0xfffffffcu); });
  refuses("a chunk of odd length", [](Bytes& file) { put(file, 24, 6); });
  refuses("chunks of odd lengths that fill the file", [](Bytes& file) {
    file.resize(48);
    put(file, 8, 48);
    put(file, 24, 6);
    put(file, 38, 2);
    put(file, 42, 0x54414857);
  });
  refuses("bytes before JSON", [](Bytes& file) { put(file, 16, 0x004e4942); });
  refuses("JSON twice", [](Bytes& file) { put(file, 28, 0x4e4f534a); });
  refuses("a gap too small for a chunk", [](Bytes& file) { put(file, 24, 4); });
  refuses("bytes as the third chunk", [](Bytes& file) {
    put(file, 28, 0x54414857);
    const Bytes third = bytesOfText(std::string("\0\0\0\0BIN\0", 8));
    file.insert(file.end(), third.begin(), third.end());
    put(file, 8, static_cast<uint32_t>(file.size()));
  });
  EXPECT_FALSE(decodeGlb(std::span(good).first(12)));
}

TEST(Glb, ReadsTheLengthOfItsJsonFromItsFirstBytes) {
  const Bytes file = encodeGlb("{\"a\": 1}", Bytes(5));
  EXPECT_EQ(readJsonLength(file, file.size()), 8u);
  EXPECT_EQ(readJsonLength(std::span(file).first(kGlbStart), file.size()), 8u);
  EXPECT_EQ(readJsonLength(std::span(file).first(kGlbStart - 1), file.size()), std::nullopt);
  EXPECT_EQ(readJsonLength(file, file.size() + 4), std::nullopt);
  for (const auto& [at, value] : std::vector<std::pair<size_t, uint32_t>>{
           {0, 0}, {4, 1}, {8, 4}, {12, 6}, {12, 0xfffffff0u}, {12, static_cast<uint32_t>(file.size())}, {16, 0}}) {
    Bytes spoilt = file;
    put(spoilt, at, value);
    EXPECT_EQ(readJsonLength(spoilt, spoilt.size()), std::nullopt) << at << " " << value;
  }
}

}  // namespace
}  // namespace tessera
