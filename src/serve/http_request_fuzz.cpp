// Fuzzes requests of arbitrary text, one header per line: paths must stay in their folder, and ranges in their file.
#include <algorithm>
#include <cstdlib>
#include <string_view>

#include "serve/http_request.h"

namespace {

std::string_view takeLine(std::string_view& text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  text.remove_prefix(std::min(line.size() + 1, text.size()));
  return line;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace tessera;
  std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto path = pathOfTarget(takeLine(text))) {
    if (path->front() != '/' || path->find("/.") != std::string::npos || path->find("//") != std::string::npos ||
        path->find('\0') != std::string::npos || path->find('\\') != std::string::npos) {
      std::abort();
    }
  }
  const std::string_view range = takeLine(text);
  for (const uint64_t bytes : {uint64_t{0}, uint64_t{1}, uint64_t{1000}, UINT64_MAX}) {
    const RangeRequest part = parseRange(range, bytes);
    if (part.kind == RangeRequest::part && !(part.range.begin < part.range.end && part.range.end <= bytes))
      std::abort();
  }
  acceptsGzip(takeLine(text));
  matchesTag(takeLine(text), "\"a-b\"");
  if (const auto host = parseHost(text); host && host->empty()) std::abort();
  return 0;
}
