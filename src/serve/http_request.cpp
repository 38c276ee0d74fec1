#include "serve/http_request.h"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace tessera {
namespace {

std::string_view trimmed(std::string_view text) {
  const auto isBlank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && isBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && isBlank(text.back())) text.remove_suffix(1);
  return text;
}

// Visits the trimmed elements of a comma-separated list; empty ones are skipped.
template <class Visit>
void forEachElement(std::string_view list, const Visit& visit) {
  while (!list.empty()) {
    const size_t comma = std::min(list.find(','), list.size());
    if (const auto element = trimmed(list.substr(0, comma)); !element.empty()) visit(element);
    list.remove_prefix(std::min(comma + 1, list.size()));
  }
}

std::optional<uint64_t> numberFrom(std::string_view text) {
  uint64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

int hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

bool equalsIgnoringCase(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) == std::tolower(static_cast<unsigned char>(y));
  });
}

bool isAllowed(const std::string& path) {
  if (path.empty() || path.front() != '/') return false;
  for (size_t i = 0; i < path.size(); ++i) {
    const auto c = static_cast<unsigned char>(path[i]);
    if (c < 0x20 || c == 0x7f || c == '\\') return false;
    if (c == '/' && i + 1 < path.size() && (path[i + 1] == '/' || path[i + 1] == '.')) return false;
  }
  return true;
}

}  // namespace

std::optional<std::string> pathOfTarget(std::string_view target) {
  target = target.substr(0, target.find_first_of("?#"));
  std::string path;
  path.reserve(target.size());
  for (size_t i = 0; i < target.size(); ++i) {
    if (target[i] != '%') {
      path.push_back(target[i]);
      continue;
    }
    const int high = i + 2 < target.size() ? hexDigit(target[i + 1]) : -1;
    const int low = i + 2 < target.size() ? hexDigit(target[i + 2]) : -1;
    if (high < 0 || low < 0) return std::nullopt;
    path.push_back(static_cast<char>(16 * high + low));
    i += 2;
  }
  if (!isAllowed(path)) return std::nullopt;
  return path;
}

RangeRequest parseRange(std::string_view header, uint64_t bytes) {
  const size_t equals = header.find('=');
  if (equals == std::string_view::npos || !equalsIgnoringCase(trimmed(header.substr(0, equals)), "bytes")) return {};
  const std::string_view range = trimmed(header.substr(equals + 1));
  const size_t dash = range.find('-');
  if (dash == std::string_view::npos || range.find(',') != std::string_view::npos) return {};
  const std::string_view from = range.substr(0, dash), to = range.substr(dash + 1);
  if (from.empty()) {  // a suffix range: the last n bytes
    const auto count = numberFrom(to);
    if (!count) return {};
    if (*count == 0 || bytes == 0) return {RangeRequest::none, {}};
    return {RangeRequest::part, {bytes - std::min(*count, bytes), bytes}};
  }
  const auto begin = numberFrom(from);
  const auto last = to.empty() ? std::optional<uint64_t>(UINT64_MAX) : numberFrom(to);
  if (!begin || !last || *last < *begin) return {};
  if (*begin >= bytes) return {RangeRequest::none, {}};
  return {RangeRequest::part, {*begin, std::min(*last, bytes - 1) + 1}};
}

bool acceptsGzip(std::string_view header) {
  bool named = false, any = false, gzip = false, anyAllowed = false;
  forEachElement(header, [&](std::string_view element) {
    const size_t semicolon = std::min(element.find(';'), element.size());
    const std::string_view coding = trimmed(element.substr(0, semicolon));
    std::string_view weight = trimmed(element.substr(std::min(semicolon + 1, element.size())));
    bool allowed = true;
    if (weight.starts_with("q=") || weight.starts_with("Q=")) {
      allowed = weight.substr(2).find_first_of("123456789") != std::string_view::npos;
    }
    if (equalsIgnoringCase(coding, "gzip") || equalsIgnoringCase(coding, "x-gzip")) {
      named = true;
      gzip = gzip || allowed;
    } else if (coding == "*") {
      any = true;
      anyAllowed = anyAllowed || allowed;
    }
  });
  return named ? gzip : any && anyAllowed;
}

bool matchesTag(std::string_view header, std::string_view tag) {
  bool matches = false;
  forEachElement(header, [&](std::string_view element) {
    if (element.starts_with("W/")) element.remove_prefix(2);
    matches = matches || element == "*" || element == tag;
  });
  return matches;
}

std::optional<std::string> parseHost(std::string_view header) {
  header = trimmed(header);
  std::string_view host = header;
  std::string_view rest;
  if (header.starts_with('[')) {
    const size_t close = header.find(']');
    if (close == std::string_view::npos) return std::nullopt;
    host = header.substr(1, close - 1);
    rest = header.substr(close + 1);
  } else {
    const size_t colon = std::min(header.find(':'), header.size());
    host = header.substr(0, colon);
    rest = header.substr(colon);
  }
  if (host.empty() || (!rest.empty() && (rest.front() != ':' || !numberFrom(rest.substr(1))))) return std::nullopt;
  std::string lower(host);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return std::tolower(c); });
  return lower;
}

}  // namespace tessera
