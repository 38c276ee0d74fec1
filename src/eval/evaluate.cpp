#include "eval/evaluate.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/image_io.h"
#include "base/log.h"
#include "eval/heat_map.h"
#include "eval/lpips.h"
#include "eval/picture_files.h"
#include "eval/psnr.h"
#include "eval/ssim.h"

namespace tessera {
namespace {

// Composites an image with straight alpha over a colour; grey becomes three channels.
ImageF colourOver(const ImageF& image, const Eigen::Array3f& background) {
  if (image.channels == 3) return image;
  ImageF result(image.width, image.height, 3);
  for (size_t p = 0; p < image.pixelCount(); ++p) {
    const float* source = image.pixels.data() + p * image.channels;
    for (int c = 0; c < 3; ++c) {
      result.pixels[3 * p + c] =
          image.channels == 1 ? source[0] : source[3] * source[c] + (1 - source[3]) * background[c];
    }
  }
  return result;
}

struct ReadPhoto {
  ImageF image;
  bool isTransparent = false;  // somewhere
};

ReadPhoto readPhoto(const Photo& photo, const Camera& camera, const Eigen::Array3f& background) {
  DecodedImage decoded = readImage(photo.image);
  if (decoded.truncated)
    warn("{}: the photo is truncated; the missing part is evaluated as grey", photo.image.string());
  if (decoded.image.width < camera.width || decoded.image.height < camera.height) {
    throw Error(photo.image.string(), "",
                fmt::format("the photo is {}×{}, smaller than its camera, {}×{}", decoded.image.width,
                            decoded.image.height, camera.width, camera.height),
                "import the capture again");
  }
  bool isTransparent = false;
  for (size_t p = 3; decoded.image.channels == 4 && p < decoded.image.pixels.size() && !isTransparent; p += 4)
    isTransparent = decoded.image.pixels[p] < 255;
  // The photo is composited first, because straight colour must not be averaged where alpha is 0.
  return {downscaleByArea(colourOver(toFloat(decoded.image), background), camera.width, camera.height), isTransparent};
}

std::optional<ImageU8> readMask(const Photo& photo, const Camera& camera) {
  if (photo.mask.empty()) return std::nullopt;
  const ImageU8 stored = resampledToNearest(readImage(photo.mask).image, camera.width, camera.height);
  ImageU8 mask(camera.width, camera.height, 1);
  for (size_t p = 0; p < mask.pixels.size(); ++p) mask.pixels[p] = stored.pixels[p * stored.channels] < 128 ? 0 : 255;
  return mask;
}

// Excludes the pixels in which the render is less than half opaque.
void limitToOpaque(std::optional<ImageU8>& mask, const ImageF& opacity) {
  if (!mask) mask.emplace(opacity.width, opacity.height, 1, uint8_t{255});
  for (size_t p = 0; p < mask->pixels.size(); ++p) {
    if (!(opacity.pixels[p] >= 0.5f)) mask->pixels[p] = 0;
  }
}

// Returns the argmin over g of Σ (g·colour + behind − photo)² on the left half, per channel.
std::array<double, 3> fittedGain(const ImageF& colour, const ImageF& behind, const ImageF& photo, const ImageU8* mask) {
  std::array<double, 3> gain = {1, 1, 1};
  for (int c = 0; c < 3; ++c) {
    double products = 0, squares = 0;
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width / 2; ++x) {
        if (mask && mask->at(x, y)[0] == 0) continue;
        const double value = colour.at(x, y)[c];
        products += value * (double{photo.at(x, y)[c]} - behind.at(x, y)[c]);
        squares += value * value;
      }
    }
    if (squares > 1e-12) gain[static_cast<size_t>(c)] = products / squares;
  }
  return gain;
}

template <class T>
Image<T> rightHalf(const Image<T>& image) {
  const int first = image.width / 2;
  Image<T> half(image.width - first, image.height, image.channels);
  for (int y = 0; y < image.height; ++y) {
    std::copy_n(image.at(first, y), static_cast<size_t>(half.width) * half.channels, half.at(0, y));
  }
  return half;
}

ImageF withMaskedPixelsFrom(ImageF image, const ImageF& other, const ImageU8& mask) {
  for (size_t p = 0; p < image.pixelCount(); ++p) {
    if (mask.pixels[p] == 0) std::copy_n(other.pixels.data() + 3 * p, 3, image.pixels.data() + 3 * p);
  }
  return image;
}

bool comparesRightHalves(const EvaluateOptions& options) {
  return options.rightHalves || options.exposures == Exposures::fitted;
}

class ViewEvaluator {
 public:
  explicit ViewEvaluator(const EvaluateOptions& options)
      : options_(options), pool_(options.threads), pictures_(options.imagesDir) {
    if (!options.lpipsWeights.empty()) lpips_.emplace(options.lpipsWeights);
  }

  std::string lpipsNet() const { return lpips_ ? lpips_->net() : std::string(); }

  void compare(const ImageF& photo, const ImageF& rendered, const ImageU8* mask, ViewResult& result) {
    if (mask) {
      const auto excluded = std::count(mask->pixels.begin(), mask->pixels.end(), uint8_t{0});
      result.compared = 1 - static_cast<double>(excluded) / static_cast<double>(mask->pixels.size());
    }
    result.psnr = tessera::psnr(rendered, photo, mask);
    result.ssim = tessera::ssim(rendered, photo, mask);
    if (lpips_ && std::min(photo.width, photo.height) >= lpips_->smallestSide()) {
      result.lpips = (*lpips_)(mask ? withMaskedPixelsFrom(rendered, photo, *mask) : rendered, photo, pool_).total;
    }
  }

  ViewResult view(ViewRenderer& renderer, const Photo& photo, const Camera& camera) {
    ViewResult result;
    result.name = photo.name;
    const auto [target, isTransparent] = readPhoto(photo, camera, renderer.background());

    const auto start = std::chrono::steady_clock::now();
    const RenderedView view = renderer.render(camera, photo.worldFromCamera);
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    CHECK(view.colour.width == camera.width);
    CHECK(view.colour.height == camera.height);
    CHECK(view.colour.channels == 3);
    std::optional<ImageU8> mask = readMask(photo, camera);
    if (!renderer.showsOutside() && !isTransparent) limitToOpaque(mask, view.opacity);
    const ImageU8* maskPointer = mask ? &*mask : nullptr;

    // The gain does not apply to the background, as in training (compute/exposure.h).
    ImageF rendered = backgroundBehind(view, renderer.background());
    if (options_.exposures == Exposures::fitted) result.gain = fittedGain(view.colour, rendered, target, maskPointer);
    if (options_.exposures == Exposures::predicted) result.gain = options_.response->gain(photo.exposure);
    for (size_t i = 0; i < rendered.pixels.size(); ++i) {
      const float value = view.colour.pixels[i] * static_cast<float>(result.gain[i % 3]) + rendered.pixels[i];
      rendered.pixels[i] = value > 0 ? std::min(value, 1.0f) : 0.0f;  // NaN becomes black, and shows as an error
    }

    std::optional<ImageF> measured;
    if (!photo.depth.empty()) measured = readDepth(photo.depth, photo.depthUnit);
    if (comparesRightHalves(options_)) {
      std::optional<ImageU8> halfMask;
      if (mask) halfMask = rightHalf(*mask);
      compare(rightHalf(target), rightHalf(rendered), halfMask ? &*halfMask : nullptr, result);
    } else {
      compare(target, rendered, maskPointer, result);
    }
    if (measured) result.depth = depthError(view.depth, view.opacity, *measured, maskPointer);
    if (!options_.imagesDir.empty()) writePictures(photo.name, target, rendered);
    if (options_.onView) {
      options_.onView(result,
                      {target, rendered, view, maskPointer, measured ? &*measured : nullptr, photo.orientation});
    }
    return result;
  }

 private:
  void writePictures(const std::string& name, const ImageF& target, const ImageF& rendered) {
    const std::string stem = pictures_.uniqueStem(name);
    writePng(pictures_.at(stem, ".png"), toBytes(rendered));
    writePng(pictures_.at(stem, ".error.png"),
             heatMap(absoluteDifference(rendered, target), 0, kBrightestError, ColourMap::inferno));
  }

  const EvaluateOptions& options_;
  ThreadPool pool_;
  std::optional<Lpips> lpips_;
  PictureFiles pictures_;
};

// Returns the mean over the views that have a value; fully masked views have no PSNR.
template <class Value>
double computeMean(const std::vector<ViewResult>& views, Value value, size_t& count) {
  double sum = 0;
  count = 0;
  for (const ViewResult& view : views) {
    const std::optional<double> number = value(view);
    if (!number || std::isnan(*number)) continue;
    sum += *number;
    ++count;
  }
  return count > 0 ? sum / static_cast<double>(count) : std::nan("");
}

void summarise(EvaluationReport& report) {
  using Number = std::optional<double>;
  size_t count = 0;
  report.psnr = computeMean(
      report.views, [](const ViewResult& v) { return Number(v.psnr); }, count);
  report.ssim = computeMean(
      report.views, [](const ViewResult& v) { return Number(v.ssim); }, count);
  report.compared = computeMean(
      report.views, [](const ViewResult& v) { return Number(v.compared); }, count);
  report.secondsPerFrame = computeMean(
      report.views, [](const ViewResult& v) { return Number(v.seconds); }, count);
  const double lpips = computeMean(
      report.views, [](const ViewResult& v) { return v.lpips; }, count);
  if (count > 0) report.lpips = lpips;
  const auto depthMean = [&](double DepthError::*member) {
    return computeMean(
        report.views, [&](const ViewResult& v) { return v.depth ? Number(*v.depth.*member) : Number(); }, count);
  };
  DepthError depth;
  depth.absoluteRelative = depthMean(&DepthError::absoluteRelative);
  depth.rootMeanSquare = depthMean(&DepthError::rootMeanSquare);
  depth.medianAbsolute = depthMean(&DepthError::medianAbsolute);
  depth.within125 = depthMean(&DepthError::within125);
  for (const ViewResult& view : report.views) depth.pixels += view.depth ? view.depth->pixels : 0;
  if (count > 0) report.depth = depth;
}

}  // namespace

EvaluationReport evaluate(ViewRenderer& renderer, const Capture& capture, const EvaluateOptions& options) {
  const std::vector<int> indices = capture.photosIn(options.split);
  if (indices.empty()) {
    throw Error(capture.root.string(), "", fmt::format("no photo is in the split \"{}\"", splitName(options.split)),
                "import with --holdout every:8, or choose another --split");
  }
  if (options.exposures == Exposures::predicted && !options.response) {
    throw Error(capture.root.string(), "", "has no response to exposures that could be predicted with",
                "evaluate with neutral exposures");
  }
  ViewEvaluator evaluator(options);
  EvaluationReport report;
  report.split = options.split;
  report.exposures = options.exposures;
  report.rightHalves = comparesRightHalves(options);
  report.lpipsNet = evaluator.lpipsNet();
  report.device = renderer.device();
  for (const int index : indices) {
    const Photo& photo = capture.photos[static_cast<size_t>(index)];
    report.views.push_back(evaluator.view(renderer, photo, capture.cameras[static_cast<size_t>(photo.camera)]));
  }
  summarise(report);
  return report;
}

}  // namespace tessera
