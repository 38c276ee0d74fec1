// Video through the `ffmpeg` program, as a subprocess (never through a shell, never linked): raw frames go in, an MP4
// with H.264 comes out, playable everywhere (yuv420p, index first).
#pragma once

#include <memory>
#include <string>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

struct VideoOptions {
  int width = 0, height = 0;  // of every frame; an odd side gains a black row or column, which the format needs
  double framesPerSecond = 24;
  int quality = 18;                // x264's constant rate factor: 0 lossless, 18 hard to tell apart, 51 worst
  std::string program = "ffmpeg";  // looked up in PATH
};

// Frames are encoded as they come. The file appears under its name when `finish` returns: before that, or without it,
// there is none. Every function throws Error: the program missing, or its own words when it failed.
class VideoWriter {
 public:
  VideoWriter(fs::path path, const VideoOptions& options);
  ~VideoWriter();  // without finish: ends the program and removes what it wrote
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  void add(const ImageU8& frame);  // 3 channels, the size of the options
  void finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tessera
