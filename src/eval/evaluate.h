// Compares held-out photos with renders of the same views.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "base/image.h"
#include "eval/depth_error.h"
#include "scene/capture.h"
#include "scene/exposure_response.h"
#include "scene/surface_coverage.h"
#include "scene/view_renderer.h"

namespace tessera {

struct ViewResult {
  std::string name;  // the photo's
  double psnr = 0;   // dB, at most kMaximumPsnr
  double ssim = 0;
  std::optional<double> lpips;             // nothing without weights, or if the image is too small for the network
  std::optional<DepthError> depth;         // nothing if the photo has no depth map
  double compared = 1;                     // share of its pixels, or of its right half's, that were compared
  std::array<double, 3> gain = {1, 1, 1};  // factor applied to the render; 1 with neutral exposures
  double seconds = 0;                      // time of rendering alone
};

// The images that were compared, all of the camera's size. The photo and the render have 3 channels in [0, 1]; the
// render lies over its background, after gain and clamping.
struct ViewPictures {
  const ImageF& photo;
  const ImageF& rendered;
  const RenderedView& view;
  const ImageU8* mask;          // 1 channel, 0 = not evaluated; null if all pixels are
  const ImageF* measuredDepth;  // the photo's, of any size; null without one
  int orientation = 1;          // of EXIF: how people look at them
};

// Photos of the same place differ in exposure. Neutral: the render is evaluated as it is. Predicted: times the gain
// that follows from the photo's exposure by EXIF. Fitted: times one gain per channel that is fitted by least squares on
// the left half of the view.
enum class Exposures { neutral, predicted, fitted };

struct EvaluateOptions {
  Split split = Split::test;
  Exposures exposures = Exposures::neutral;
  std::optional<ExposureResponse> response;  // for Exposures::predicted, which needs it
  // Colour is evaluated on the right half of each view alone, as it is with fitted exposures (depth, which does not
  // depend on exposure, on the whole view): to compare with these.
  bool rightHalves = false;
  fs::path lpipsWeights;  // safetensors; empty: no LPIPS
  fs::path imagesDir;     // where NAME.png and NAME.error.png of each view are written; empty: nowhere
  int threads = 0;        // of LPIPS; 0: all
  // Called after each view, in the order of the capture. The images are valid only during the call.
  std::function<void(const ViewResult&, const ViewPictures&)> onView;
};

struct EvaluationReport {
  double psnr = 0, ssim = 0;        // means over views
  double compared = 1;              // mean share of the pixels that were compared
  std::optional<double> lpips;      // mean over the views that have it
  std::string lpipsNet;             // "alex"; empty without weights
  std::optional<DepthError> depth;  // means over the views that have it; `pixels` is the sum
  std::vector<ViewResult> views;
  double secondsPerFrame = 0;
  std::string device;
  Split split = Split::test;
  Exposures exposures = Exposures::neutral;
  bool rightHalves = false;  // whether colour was evaluated on these alone
  // Of the surfaces of what was evaluated: for callers that know it to set. Empty if it was not checked.
  std::vector<SurfaceCoverage> coverage;
};

// Evaluates all photos of the split. The premultiplied colour of the render is multiplied by the gain, composited over
// renderer.background(), clamped to [0, 1], and compared, unrounded, with the photo's bytes / 255. Photos larger than
// their camera are downscaled by area averaging; photos with alpha are composited over the same background. Where a
// photo has a mask, its black pixels are excluded from PSNR, windows that touch one are excluded from SSIM, and for
// LPIPS they are replaced in the render by the photo's pixels. Unless ViewRenderer::showsOutside, pixels of photos
// that are opaque everywhere in which the render is less than half opaque are excluded in the same way: they show what
// lies outside.
//
// Throws Error if predicted exposures have no response, or if the split is empty, or a photo, mask, depth or the
// weights cannot be read.
EvaluationReport evaluate(ViewRenderer& renderer, const Capture& capture, const EvaluateOptions& options);

// Returns one JSON object: psnr, ssim, lpips (null without weights), lpips_net, depth (null without depth maps),
// views[], seconds_per_frame, device, exposure, split, coverage[] if there is any, units. Undefined numbers are null.
std::string toJson(const EvaluationReport& report);

std::string_view splitName(Split split);
std::optional<Split> splitFromName(std::string_view name);
std::optional<Exposures> exposuresFromName(std::string_view name);
std::string describeExposures(const EvaluationReport& report);  // "neutral", or how they were predicted or fitted

}  // namespace tessera
