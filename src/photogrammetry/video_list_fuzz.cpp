// Decodes untrusted bytes as what ffprobe and ffmpeg tell of a video.
#include <cstddef>

#include "photogrammetry/video_list.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto stream = tessera::parseVideoStream(text); stream && stream->frames < 0) __builtin_trap();
  tessera::parseFrameTimes(text);
  tessera::parsePnmHeader(text);
  return 0;
}
