// Parses the parts of HTTP requests, which are untrusted text, according to RFC 9110 and 9112, as far as a server of
// files needs them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tessera {

// The bytes [begin, end) of a file.
struct ByteRange {
  uint64_t begin = 0, end = 0;
  bool operator==(const ByteRange&) const = default;
};

// Returns the path of a request target, without its query, percent-decoded: "/a/b.glb". Returns nothing if it is not an
// absolute path, has an empty part or one that begins with a dot, or contains a backslash, a control character or an
// invalid percent escape.
std::optional<std::string> pathOfTarget(std::string_view target);

// The range that a Range header requests. `whole`: the header is ignored, because it is malformed, has another unit, or
// requests several ranges, which servers may answer with the whole file. `none`: the range contains no byte of the file
// (status 416).
struct RangeRequest {
  enum Kind { whole, part, none } kind = whole;
  ByteRange range;
};
// `bytes`: the size of the file.
RangeRequest parseRange(std::string_view header, uint64_t bytes);

// Returns whether an Accept-Encoding header allows gzip (RFC 9110, section 12.5.3).
bool acceptsGzip(std::string_view header);

// Returns whether an If-None-Match header contains the entity tag, given with its quotation marks; weak tags match.
bool matchesTag(std::string_view header, std::string_view tag);

// Returns the host of a Host header without its port, in lower case: "localhost", "127.0.0.1", "::1". Returns nothing
// if the header is malformed.
std::optional<std::string> parseHost(std::string_view header);

}  // namespace tessera
