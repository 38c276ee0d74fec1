#include "serve/compressor.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <future>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class CompressorTest : public testing::Test {
 protected:
  std::shared_ptr<const SiteFile> file(const std::string& name, const std::string& text) const {
    writeFileAtomically(folder_ / name, text);
    return SiteFile::open(folder_.path(), name).file;
  }
  static std::future<Compressor::Body> compressed(Compressor& compressor, const std::shared_ptr<const SiteFile>& file) {
    auto promise = std::make_shared<std::promise<Compressor::Body>>();
    compressor.compress(file, [promise](const Compressor::Body& body) { promise->set_value(body); });
    return promise->get_future();
  }
  // Returns text that compresses to about half its size.
  static std::string makeText(size_t bytes, uint32_t seed = 1) {
    std::string text(bytes, ' ');
    for (char& c : text) c = "0123456789abcdef"[(seed = seed * 1664525 + 1013904223) >> 28];
    return text;
  }
  static std::string inflated(const std::string& bytes, size_t maximum) {
    std::string text(maximum, '\0');
    z_stream stream{};
    EXPECT_EQ(inflateInit2(&stream, 15 + 16), Z_OK);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
    stream.avail_in = static_cast<uInt>(bytes.size());
    stream.next_out = reinterpret_cast<Bytef*>(text.data());
    stream.avail_out = static_cast<uInt>(text.size());
    EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
    text.resize(stream.total_out);
    inflateEnd(&stream);
    return text;
  }

  TemporaryFolder folder_;
};

TEST_F(CompressorTest, CompressesWholeFilesAsGzip) {
  Compressor compressor(1 << 20);
  for (const size_t bytes : {1024, 32768, 32769, 65536, 300000}) {
    const std::string text = makeText(bytes);
    const Compressor::Body body = compressed(compressor, file("a.json", text)).get();
    ASSERT_TRUE(body);
    EXPECT_LT(body->size(), bytes * 3 / 4);
    EXPECT_EQ(inflated(*body, bytes + 1), text);
  }
}

TEST_F(CompressorTest, CompressesOnceForConcurrentRequests) {
  Compressor compressor(0);  // caches nothing
  std::promise<void> asked;
  compressor.compress(file("before.json", makeText(1000)), [&](const Compressor::Body&) { asked.get_future().wait(); });
  const auto text = file("a.json", makeText(100000));
  auto first = compressed(compressor, text), second = compressed(compressor, text);
  asked.set_value();
  const Compressor::Body body = first.get();
  EXPECT_EQ(second.get(), body);
  EXPECT_NE(compressed(compressor, text).get(), body);
}

TEST_F(CompressorTest, CachesTheMostRecentlyUsedResults) {
  Compressor compressor(150000);
  const auto a = file("a.json", makeText(100000, 1)), b = file("b.json", makeText(100000, 2));
  const auto c = file("c.json", makeText(100000, 3));  // about 57 kB each when compressed: two fit
  const Compressor::Body bodyOfA = compressed(compressor, a).get(), bodyOfB = compressed(compressor, b).get();
  EXPECT_EQ(compressed(compressor, a).get(), bodyOfA);
  EXPECT_GT(compressor.bytes(), bodyOfA->size() + bodyOfB->size());
  compressed(compressor, c).get();
  EXPECT_LE(compressor.bytes(), 150000u);
  EXPECT_EQ(compressed(compressor, a).get(), bodyOfA);
  EXPECT_NE(compressed(compressor, b).get(), bodyOfB) << "it is the least recently used";
  const size_t bytes = compressor.bytes();
  EXPECT_TRUE(compressed(compressor, file("large.json", makeText(1000000))).get());
  EXPECT_EQ(compressor.bytes(), bytes) << "a result larger than the cache evicts nothing";
}

TEST_F(CompressorTest, DetectsThatAFileHasChanged) {
  Compressor compressor(1 << 20);
  const Compressor::Body old = compressed(compressor, file("a.json", makeText(2000, 1))).get();
  const std::string newer = makeText(2000, 2) + " ";
  EXPECT_EQ(inflated(*compressed(compressor, file("a.json", newer)).get(), 3000), newer);
}

TEST_F(CompressorTest, ReturnsNothingForATruncatedFile) {
  Compressor compressor(1 << 20);
  const auto text = file("a.json", makeText(100000));
  fs::resize_file(folder_ / "a.json", 50000);
  EXPECT_FALSE(compressed(compressor, text).get());
  EXPECT_EQ(compressor.bytes(), 0u);
}

TEST_F(CompressorTest, StopsWithFilesStillQueued) {
  int heard = 0;
  std::promise<void> begun;
  {
    Compressor compressor(1 << 20);
    compressor.compress(file("a.json", makeText(1000)), [&](const Compressor::Body&) {
      begun.set_value();
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    });
    for (int i = 0; i < 5; ++i) {
      compressor.compress(file(std::to_string(i), makeText(1000)), [&](const Compressor::Body&) { ++heard; });
    }
    begun.get_future().wait();
  }
  EXPECT_EQ(heard, 0);
}

}  // namespace
}  // namespace tessera
