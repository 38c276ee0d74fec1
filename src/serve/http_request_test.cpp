#include "serve/http_request.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(PathOfTarget, DecodesThePathWithoutTheQuery) {
  EXPECT_EQ(pathOfTarget("/"), "/");
  EXPECT_EQ(pathOfTarget("/scene/tiles/L0/a-0f.glb?v=1#x"), "/scene/tiles/L0/a-0f.glb");
  EXPECT_EQ(pathOfTarget("/a%20b/%C3%A9.json"), "/a b/é.json");
}

TEST(PathOfTarget, RejectsPathsThatCouldLeaveAFolder) {
  for (const char* target : {"",
                             "a",
                             "*",
                             "http://x/a",
                             "/..",
                             "/../etc/passwd",
                             "/a/../b",
                             "/a/..",
                             "/./a",
                             "/.git/config",
                             "/a//b",
                             "//etc/passwd",
                             "/%2e%2e/x",
                             "/a%2f..%2fb",
                             "/a%2F%2Fb",
                             "/..%2f",
                             "/%2e/x",
                             "/a\\..\\b",
                             "/%5c..%5cx",
                             "/a%00.glb",
                             "/a%0d%0ab",
                             "/%",
                             "/%2",
                             "/%zz",
                             "/a/%2e%2e%2fb",
                             "/%c0%ae/\x01"}) {
    EXPECT_EQ(pathOfTarget(target), std::nullopt) << target;
  }
}

TEST(ParseRange, ReturnsTheRequestedPartOfTheFile) {
  const auto part = [](const char* header) { return parseRange(header, 100); };
  EXPECT_EQ(part("bytes=0-9").range, (ByteRange{0, 10}));
  EXPECT_EQ(part("bytes=90-").range, (ByteRange{90, 100}));
  EXPECT_EQ(part("bytes=-7").range, (ByteRange{93, 100}));
  EXPECT_EQ(part("bytes=-700").range, (ByteRange{0, 100}));
  EXPECT_EQ(part("BYTES = 99-4000").range, (ByteRange{99, 100}));
  EXPECT_EQ(part("bytes=99-18446744073709551615").range, (ByteRange{99, 100}));
  EXPECT_EQ(part("bytes=0-9").kind, RangeRequest::part);
}

TEST(ParseRange, ReturnsNoneBeyondTheEndAndTheWholeFileIfMalformed) {
  for (const char* header : {"bytes=100-", "bytes=100-200", "bytes=-0"}) {
    EXPECT_EQ(parseRange(header, 100).kind, RangeRequest::none) << header;
  }
  EXPECT_EQ(parseRange("bytes=0-", 0).kind, RangeRequest::none);
  for (const char* header : {"", "bytes", "bytes=", "bytes=-", "bytes=a-b", "bytes=5-2", "lines=0-1", "bytes=0-1,3-4",
                             "bytes=0x1-2", "bytes=-1-2", "bytes=99999999999999999999-"}) {
    EXPECT_EQ(parseRange(header, 100).kind, RangeRequest::whole) << header;
  }
}

TEST(AcceptsGzip, RespectsWeightsAndWildcards) {
  for (const char* header : {"gzip", "br, gzip;q=0.5", "*", "GZIP", "x-gzip", "deflate, *;q=0.1"}) {
    EXPECT_TRUE(acceptsGzip(header)) << header;
  }
  for (const char* header : {"", "br", "gzip;q=0", "gzip;q=0.000, *", "*;q=0", "identity"}) {
    EXPECT_FALSE(acceptsGzip(header)) << header;
  }
}

TEST(MatchesTag, ComparesTagsOfAList) {
  EXPECT_TRUE(matchesTag("\"a\"", "\"a\""));
  EXPECT_TRUE(matchesTag("\"b\", W/\"a\"", "\"a\""));
  EXPECT_TRUE(matchesTag("*", "\"a\""));
  EXPECT_FALSE(matchesTag("\"b\"", "\"a\""));
  EXPECT_FALSE(matchesTag("", "\"a\""));
}

TEST(ParseHost, ReturnsTheHostWithoutThePort) {
  EXPECT_EQ(parseHost("LocalHost:8080"), "localhost");
  EXPECT_EQ(parseHost("127.0.0.1"), "127.0.0.1");
  EXPECT_EQ(parseHost("[::1]:80"), "::1");
  for (const char* header : {"", ":80", "[::1", "a:b", "a:", "[::1]80"})
    EXPECT_EQ(parseHost(header), std::nullopt) << header;
}

}  // namespace
}  // namespace tessera
