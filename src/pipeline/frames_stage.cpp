#include "pipeline/frames_stage.h"

#include <fmt/format.h>

#include "base/progress.h"

namespace tessera {
namespace {

std::string takeFrames(VideoFrames& frames, const fs::path& folder, const std::function<bool()>& interrupted) {
  const auto watch = [&interrupted](Progress& progress) {
    return [&interrupted, &progress](int64_t done) {
      progress.update(done);
      if (interrupted()) throw RunInterrupted();
    };
  };
  VideoStream stream;
  {
    Progress progress("sharpness", 0, "frames");
    stream = frames.inspect(watch(progress));
    progress.setTotal(stream.frames);
    frames.choose(watch(progress));
  }
  Progress progress("frames", static_cast<int64_t>(frames.chosen()), "frames");
  frames.extract(watch(progress));
  const std::string length = stream.seconds > 0 ? fmt::format(" of {:.1f} s", stream.seconds) : "";
  return fmt::format("{} frames of a video{}, in {}", frames.chosen(), length, folder.string());
}

}  // namespace

VideoPhotos::VideoPhotos(const PhotoRunOptions& options)
    : options_(options),
      frames_(std::make_shared<VideoFrames>(options.photos, folder(),
                                            VideoFrameOptions{.count = options.frames, .threads = options.threads})) {}

fs::path VideoPhotos::folder() const {
  return options_.out / "frames";
}

Stage VideoPhotos::stage() const {
  return {.name = "frames",
          .settings = frames_->origin(),
          .isComplete = [frames = frames_] { return frames->isComplete(); },
          .discard = [frames = frames_] { frames->discard(); },
          .needs =
              [frames = frames_, &options = options_](bool) {
                const auto stop = [&options](int64_t) {
                  if (options.interrupted()) throw RunInterrupted();
                };
                return planFrames(frames->inspect(stop), options.frames);
              },
          .run = [frames = frames_, folder = folder(),
                  &options = options_](bool) { return takeFrames(*frames, folder, options.interrupted); }};
}

}  // namespace tessera
