// report.html of a run: one self-contained page, which works offline and without scripts, on what became of the photos.
// The page of the evaluation, evaluation.html beside it, is linked.
#pragma once

#include <string>
#include <vector>

#include "base/file.h"
#include "photogrammetry/photo_list.h"

namespace tessera {

struct RunReportInput {
  std::string title;  // the name of the folder of photos
  std::string method;
  std::vector<ListedPhoto> photos;    // that can be used
  std::vector<LeftOutPhoto> leftOut;  // that cannot
  bool hasEvaluation = true;          // of held-out photos
};

inline constexpr size_t kThumbnails = 8;
inline constexpr int kThumbnailSide = 240;  // pixels

// Returns the page on the run in the folder `out`, from what its stages have written there: run.json,
// poses/georeference.json, poses/left_out.json, scene/ and, if there is an evaluation, eval.json. Throws Error naming a
// file that is damaged and what to do.
std::string runReport(const fs::path& out, const RunReportInput& input);

}  // namespace tessera
