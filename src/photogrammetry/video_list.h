// What `ffprobe` and `ffmpeg` tell of a video: its pictures and their times. Decoders of untrusted bytes: they return
// nothing for what they cannot use, and their memory is bounded by the length of the input.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tessera {

// The pictures of a video, as its file states them. Numbers are 0 where they are unknown; none of them is reliable.
struct VideoStream {
  int width = 0, height = 0;  // as stored; rotation and the shape of pixels change it
  int64_t frames = 0;
  double seconds = 0;
  double framesPerSecond = 0;  // the mean
  bool isHdr = false;          // its brightness is coded as HLG or PQ
};

// Decodes the JSON of `ffprobe -show_entries
// stream=width,height,nb_frames,duration,avg_frame_rate,color_transfer:format=duration`: its first stream. Nothing:
// there is no stream with pictures.
std::optional<VideoStream> parseVideoStream(std::string_view json);

// Decodes the text of the format `framecrc`: the presentation time of each frame in seconds, in the order of the file.
std::optional<std::vector<double>> parseFrameTimes(std::string_view text);

// The header of a picture in the formats PGM and PPM (binary, of 8 bits) as ffmpeg writes it.
struct PnmHeader {
  int width = 0, height = 0, channels = 0;  // 1 or 3 channels
};
inline constexpr size_t kMaxPnmHeader = 40;  // bytes
std::optional<PnmHeader> parsePnmHeader(std::string_view text);

}  // namespace tessera
