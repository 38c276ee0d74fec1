// What a client asks for, taken apart: untrusted text. RFC 9110 and 9112, as far as a server of files needs them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace tessera {

// Bytes `begin` to before `end` of a file.
struct ByteRange {
  uint64_t begin = 0, end = 0;
  bool operator==(const ByteRange&) const = default;
};

// The path of a request target, without its query, percent-decoded: "/a/b.glb". Nothing where it is no absolute path,
// or holds what no file of ours is called: an empty part, one that begins with a dot, a backslash, a control character,
// a percent sign that is none.
std::optional<std::string> pathOfTarget(std::string_view target);

// What a Range header asks of a file of so many bytes. `whole`: it is to be passed over, as it is malformed, of another
// unit, or asks for several ranges, which servers may answer with all. `none`: no byte of the file is in it (416).
struct RangeRequest {
  enum Kind { whole, part, none } kind = whole;
  ByteRange range;
};
RangeRequest rangeOf(std::string_view header, uint64_t bytes);

// Whether an Accept-Encoding header allows gzip (RFC 9110, section 12.5.3).
bool acceptsGzip(std::string_view header);

// Whether an If-None-Match header names the entity tag, given with its quotation marks; weak tags match.
bool matchesTag(std::string_view header, std::string_view tag);

// The host of a Host header without its port: "localhost", "127.0.0.1", "::1". Nothing where it is malformed.
std::optional<std::string> hostOf(std::string_view header);

}  // namespace tessera
