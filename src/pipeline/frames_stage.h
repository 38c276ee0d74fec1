// The stage `frames` of `tessera run`: photos from a video.
#pragma once

#include <memory>

#include "photogrammetry/video_frames.h"
#include "pipeline/photo_run.h"

namespace tessera {

class VideoPhotos {
 public:
  // Of the video `options.photos`. `options` must outlive this object and its stage.
  explicit VideoPhotos(const PhotoRunOptions& options);

  fs::path folder() const;  // that the photos are written to
  bool areComplete() const { return frames_->isComplete(); }
  Stage stage() const;

 private:
  const PhotoRunOptions& options_;
  std::shared_ptr<VideoFrames> frames_;
};

}  // namespace tessera
