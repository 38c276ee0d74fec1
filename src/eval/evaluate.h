// Held-out photos against renderings of the same views.
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
#include "scene/view_renderer.h"

namespace tessera {

struct ViewResult {
  std::string name;  // the photo's
  double psnr = 0;   // dB, at most kMaximumPsnr
  double ssim = 0;
  std::optional<double> lpips;             // without weights, or for a picture too small for the network, nothing
  std::optional<DepthError> depth;         // where the photo has a depth map
  std::array<double, 3> gain = {1, 1, 1};  // what the rendering was multiplied by; 1 with neutral exposure
  double seconds = 0;                      // of rendering alone
};

// The pictures that were compared, all of the camera's size. In [0, 1], 3 channels: the photo as floats, the rendering
// over its background, after gain and clamp.
struct ViewPictures {
  const ImageF& photo;
  const ImageF& rendered;
  const RenderedView& view;
  const ImageU8* mask;          // 1 channel, 0 = not judged; null without one
  const ImageF* measuredDepth;  // the photo's, of any size; null without one
};

struct EvaluateOptions {
  Split split = Split::test;
  // Photos of one place differ in exposure. Neutral: the rendering is judged as it is. Fitted: one gain per channel,
  // least squares on the left half of the view, and colour is judged on the right half alone (depth, which has no
  // exposure, everywhere).
  bool fitExposure = false;
  fs::path lpipsWeights;  // safetensors; empty: no LPIPS
  fs::path imagesDir;     // NAME.png and NAME.error.png of each view go here; empty: none are written
  int threads = 0;        // for LPIPS; 0: all
  // Called after each view, in the order of the capture. The pictures live only during the call.
  std::function<void(const ViewResult&, const ViewPictures&)> onView;
};

struct EvaluationReport {
  double psnr = 0, ssim = 0;        // means over views
  std::optional<double> lpips;      // mean over the views that have it
  std::string lpipsNet;             // "alex"; empty without weights
  std::optional<DepthError> depth;  // means over the views that have it; `pixels` is the sum
  std::vector<ViewResult> views;
  double secondsPerFrame = 0;
  std::string device;
  Split split = Split::test;
  bool fitExposure = false;
};

// The rendering's premultiplied colour is laid over renderer.background(), multiplied by the gain, clamped to [0, 1],
// and compared, unrounded, with the photo's bytes / 255. Photos larger than their camera are reduced by area; photos
// with alpha are laid over the same background. Where a photo has a mask, black pixels do not enter PSNR, windows that
// touch one do not enter SSIM, and LPIPS sees the photo's own pixels there in both pictures.
//
// Throws Error when the split is empty, or a photo, mask, depth or the weights cannot be read.
EvaluationReport evaluate(ViewRenderer& renderer, const Capture& capture, const EvaluateOptions& options);

// One JSON object: psnr, ssim, lpips (null without weights), lpips_net, depth (null without depth maps), views[],
// seconds_per_frame, device, exposure, split, units. Numbers that do not exist are null.
std::string toJson(const EvaluationReport& report);

std::string_view splitName(Split split);
std::optional<Split> splitFromName(std::string_view name);
std::string_view exposureName(bool fitted);  // "neutral", or how it was fitted

}  // namespace tessera
