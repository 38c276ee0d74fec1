#include "pipeline/run_request.h"

#include <fmt/format.h>

#include "base/error.h"
#include "import/holdout.h"

namespace tessera {

bool liesIn(const fs::path& path, const fs::path& folder) {
  const fs::path inside =
      fs::weakly_canonical(fs::absolute(path)).lexically_relative(fs::weakly_canonical(fs::absolute(folder)));
  return !inside.empty() && *inside.begin() != "..";
}

void requireUsableRequest(const PhotoRunOptions& options) {
  std::error_code status;
  const bool isFile = fs::is_regular_file(options.photos, status);
  if (!isFile && !fs::is_directory(options.photos, status))
    throw Error(options.photos.string(), "", "is neither a folder nor a file", "name a folder of photos, or a video");
  if (!isFile && options.frames > 0)
    throw Error("--frames", "", "concerns videos, and this is a folder", "leave it out, or name a video");
  if (liesIn(options.out, options.photos)) {
    throw Error(options.out.string(), "", "is the folder of photos, or in it: its pictures would be taken for photos",
                "name another folder to write to");
  }
  checkHoldOut(options.holdout);
  for (const char* name : {"frames", "poses", "capture", "model", "scene", "probe", "logs", "report.html",
                           "evaluation.html", "eval.json"}) {
    if (!fs::exists(options.out / name, status) || fs::exists(options.out / "run.json", status)) continue;
    throw Error((options.out / name).string(), "", "was not made by such a run, and would be replaced",
                "name another folder to write to");
  }
}

std::string describeRequest(const PhotoRunOptions& options) {
  std::string text = fmt::format("run {} {} --method {} --device {} --holdout {}", options.photos.string(),
                                 options.out.string(), options.method, options.device, options.holdout);
  text += options.steps > 0 ? fmt::format(" --steps {}", options.steps) : fmt::format(" --minutes {}", options.minutes);
  if (options.downscale > 0) text += fmt::format(" --downscale {}", options.downscale);
  if (options.frames > 0) text += fmt::format(" --frames {}", options.frames);
  if (options.threads > 0) text += fmt::format(" --threads {}", options.threads);
  if (!options.masks.empty()) text += " --masks " + options.masks.string();
  if (!options.range.from.empty()) text += " --from " + options.range.from;
  if (!options.range.until.empty()) text += " --until " + options.range.until;
  return text;
}

}  // namespace tessera
