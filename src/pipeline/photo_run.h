// From a folder of photos, or a video, to a scene: the stages of `tessera run`. Photos with poses, in a format that
// `import` reads, begin at the stage `capture`.
//
//   (plan)    how long features and matches take of a few photos     probe.json
//   frames    of a video: its sharpest frames as photos              frames/
//   inspect   which photos can be used; cameras, flights             run.json
//   features  COLMAP's features                                      poses/database.db
//   pairs     which photos are compared                              poses/pairs.json
//   matches   COLMAP's matches of these pairs                        poses/database.db
//   mapping   COLMAP's models                                        poses/sparse
//   remapping models that share photos joined, more photos added     poses/joined
//   adjusting the final bundle adjustment of the largest model       poses/adjusted, poses/left_out.json
//   georeferencing  the similarity to metres that GPS gives           poses/georeference.json
//   capture   this model, in metres if it has a georeference         capture/
//   train, bake, evaluate   this program's verbs, as processes       model/, scene/, evaluation.html, eval.json
//   report    a page on all of this                                  report.html
#pragma once

#include <functional>
#include <string>

#include "base/file.h"
#include "pipeline/run_plan.h"
#include "pipeline/stage.h"
#include "scene/capture.h"

namespace tessera {

struct PhotoRunOptions {
  fs::path photos, out;  // `photos`: a folder, a video, or a source with poses
  int frames = 0;        // of a video; 0: as many as suit it (photogrammetry/frame_choice.h)
  fs::path masks;        // a folder, as for PhotoMasks; empty: photos have no masks, or those of their source
  std::string method;
  double minutes = 10;           // of training
  int64_t steps = 0;             // instead of minutes, if above 0
  int downscale = 0;             // 0: chooseDownscale
  std::string holdout = "auto";  // as for `import`; of photos without poses: every:8
  std::string device = "cpu";    // of training, baking and evaluating: DeviceOptions::kind
  int threads = 0;               // 0: all
  std::string program;           // this program, which trains, bakes and evaluates
  TrainingCosts costs;           // of `method`, for one block
  // Returns those for the blocks of a capture. Its photos are not read. Empty: they are `costs`.
  std::function<TrainingCosts(const Capture&)> costsOnCapture;
  bool dryRun = false;  // prints what the run will take, and ends
  StageRange range;
  std::function<bool()> interrupted = [] { return false; };  // asked for now and then; stops the run
};

// Thrown where `interrupted` has said so. What was done so far is kept.
struct RunInterrupted {};

// States what will be taken, and runs what is not finished. Throws Error before the first stage if memory or disk are
// too small. Throws Error naming what cannot go on, or RunInterrupted; what was done so far is kept.
void runFromPhotos(const PhotoRunOptions& options);

}  // namespace tessera
