// Encodes video with the `ffmpeg` program as a subprocess (never through a shell, never linked): from raw frames to an
// MP4 with H.264 that plays everywhere (yuv420p, index first).
#pragma once

#include <memory>
#include <string>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

struct VideoOptions {
  int width = 0, height = 0;  // of every frame; the format requires even sides: odd ones gain a black row or column
  double framesPerSecond = 24;
  int quality = 18;                // x264's constant rate factor: 0 lossless, 18 visually lossless, 51 worst
  std::string program = "ffmpeg";  // looked up in PATH
};

// Encodes frames as they are added. The file appears under its name when `finish` returns; before that, or without it,
// there is none. What a killed process left is removed by the next one. Every function throws Error if the program is
// missing, or with its messages if it failed.
class VideoWriter {
 public:
  VideoWriter(fs::path path, const VideoOptions& options);
  ~VideoWriter();  // without finish: kills the program and removes what it wrote
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  void add(const ImageU8& frame);  // 3 channels, the size of the options
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
