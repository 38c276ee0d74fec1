// Photos from a video: the sharpest frame of each interval, taken by the program `ffmpeg`, which is run as it is
// installed, never linked. It reads the video twice: small grey pictures of all frames, of which none is kept, tell how
// sharp each is; then the chosen ones are stored at full size. Frames are turned as the video says (phones), stretched
// to square pixels, and freed from interlacing.
//
//   frames.json         the chosen frames, with their times
//   frame_000123.jpg    by number, the first frame of the video being 0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "photogrammetry/video_list.h"

namespace tessera {

struct VideoFrameOptions {
  int count = 0;    // as for chooseFrames
  int threads = 0;  // of the decoder; 0: all
  std::string program = "ffmpeg", probe = "ffprobe";
};

class VideoFrames {
 public:
  // `folder` is created when it is written to.
  VideoFrames(fs::path video, fs::path folder, VideoFrameOptions options);

  // Called a few times a second. What it throws ends the program that runs.
  using Watch = std::function<void(int64_t done)>;

  // Returns what the file states of its pictures, which it reads once. Throws Error if it is no video, or the program
  // is missing.
  VideoStream inspect(const Watch& watch);
  // Chooses frames, unless that has been done, and warns of HDR if it has been inspected. Throws Error if the video has
  // fewer than three or cannot be decoded.
  void choose(const Watch& watch);
  size_t chosen() const;  // how many
  // Stores the chosen frames that are not there yet. Throws Error if the program fails.
  void extract(const Watch& watch);

  // What the choice depends on: the contents of the video (fileDigest), and the number asked for.
  std::string origin() const;
  bool isComplete() const;  // whether all frames chosen of this origin are there
  void discard() const;     // removes them all, which are of another video or number

 private:
  struct Decoding;
  fs::path listFile() const { return folder_ / "frames.json"; }
  std::string frameFile(int64_t frame) const;
  std::vector<std::string> command(const std::string& program) const;

  fs::path video_, folder_;
  VideoFrameOptions options_;
  std::optional<VideoStream> stream_;
};

}  // namespace tessera
