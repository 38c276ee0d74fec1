#include "photogrammetry/video_list.h"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace tessera {
namespace {

constexpr int kMaxSide = 1 << 16;
constexpr double kMaxSeconds = 1e9;

template <class T>
std::optional<T> parseWhole(std::string_view text) {
  while (text.starts_with(' ')) text.remove_prefix(1);
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Numbers stand in JSON as numbers or, most of them, as texts; "N/A" is unknown.
std::string textIn(const nlohmann::json& object, const char* key) {
  const auto entry = object.find(key);
  if (entry == object.end()) return "";
  if (entry->is_string()) return entry->get<std::string>();
  return entry->is_number_integer() ? std::to_string(entry->get<int64_t>()) : "";
}

double secondsIn(const nlohmann::json& object) {
  const double seconds = parseWhole<double>(textIn(object, "duration")).value_or(0);
  return seconds > 0 && seconds < kMaxSeconds ? seconds : 0;
}

// "30000/1001"
std::optional<double> parseRatio(std::string_view text) {
  const size_t slash = text.find('/');
  if (slash == text.npos) return std::nullopt;
  const auto above = parseWhole<int64_t>(text.substr(0, slash)), below = parseWhole<int64_t>(text.substr(slash + 1));
  if (!above || !below || *above <= 0 || *below <= 0) return std::nullopt;
  return static_cast<double>(*above) / static_cast<double>(*below);
}

}  // namespace

std::optional<VideoStream> parseVideoStream(std::string_view text) {
  const auto json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  const auto streams = json.find("streams");
  if (streams == json.end() || !streams->is_array() || streams->empty() || !streams->front().is_object())
    return std::nullopt;
  const nlohmann::json& first = streams->front();
  VideoStream stream;
  stream.width = parseWhole<int>(textIn(first, "width")).value_or(0);
  stream.height = parseWhole<int>(textIn(first, "height")).value_or(0);
  if (stream.width < 1 || stream.height < 1 || stream.width > kMaxSide || stream.height > kMaxSide) return std::nullopt;
  stream.seconds = secondsIn(first);
  // Some containers state it for the whole file alone.
  const auto format = json.find("format");
  if (stream.seconds == 0 && format != json.end() && format->is_object()) stream.seconds = secondsIn(*format);
  stream.framesPerSecond = parseRatio(textIn(first, "avg_frame_rate")).value_or(0);
  const std::string transfer = textIn(first, "color_transfer");
  stream.isHdr = transfer == "arib-std-b67" || transfer == "smpte2084";
  constexpr double kMaxFrames = 1e12;
  const double frames = static_cast<double>(parseWhole<int64_t>(textIn(first, "nb_frames")).value_or(0));
  const double estimate = frames > 0 ? frames : std::round(stream.seconds * stream.framesPerSecond);
  if (estimate > 0 && estimate < kMaxFrames) stream.frames = static_cast<int64_t>(estimate);
  return stream;
}

std::optional<std::vector<double>> parseFrameTimes(std::string_view text) {
  // #tb 0: 1/1000
  // 0,         33,         33,       33,     4800, 0x44616a3f       stream, decoding time, presentation time, …
  constexpr std::string_view kUnit = "#tb 0: ";
  std::optional<double> unit;
  std::vector<double> times;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (line.starts_with(kUnit)) unit = parseRatio(line.substr(kUnit.size()));
    if (line.empty() || line.starts_with('#')) continue;
    const size_t first = line.find(','), second = first == line.npos ? line.npos : line.find(',', first + 1),
                 third = second == line.npos ? line.npos : line.find(',', second + 1);
    if (!unit || third == line.npos) return std::nullopt;
    const auto time = parseWhole<int64_t>(line.substr(second + 1, third - second - 1));
    if (!time) return std::nullopt;
    times.push_back(static_cast<double>(*time) * *unit);
    if (!(std::abs(times.back()) < kMaxSeconds)) return std::nullopt;
  }
  return times;
}

std::optional<PnmHeader> parsePnmHeader(std::string_view text) {
  // P6 <line> 640 360 <line> 255 <line>
  constexpr std::string_view kDepth = "\n255\n";
  PnmHeader header;
  header.channels = text.starts_with("P5\n") ? 1 : text.starts_with("P6\n") ? 3 : 0;
  if (header.channels == 0 || text.size() > kMaxPnmHeader || text.size() < 3 + kDepth.size() || !text.ends_with(kDepth))
    return std::nullopt;
  const std::string_view size = text.substr(3, text.size() - 3 - kDepth.size());
  const size_t space = size.find(' ');
  if (space == size.npos) return std::nullopt;
  header.width = parseWhole<int>(size.substr(0, space)).value_or(0);
  header.height = parseWhole<int>(size.substr(space + 1)).value_or(0);
  if (header.width < 1 || header.height < 1 || header.width > kMaxSide || header.height > kMaxSide) return std::nullopt;
  return header;
}

}  // namespace tessera
