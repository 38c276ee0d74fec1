// The loss between rendered and photographed colours: applies the exposure, then the colour loss, and propagates
// gradients back through the exposure.
//
//   loss.compare(photoRays, picture, losses);
//   ... add gradients of further losses on the exposed colours to loss.colourGradients()
//   loss.passBack(photoRays, picture);
#pragma once

#include "compute/losses.h"
#include "train/photo_exposures.h"
#include "train/photo_rays.h"
#include "train/settings/losses.h"

namespace tessera {

class PhotoLoss {
 public:
  // Throws Error if settings.loss names no colour loss. Keeps a reference to `device`.
  PhotoLoss(Device& device, const Capture& capture, const PhotoLossSettings& settings, uint32_t maxRays);

  // The rendered colours of rays [first, first + count) of the step; only the first `finished` rays contribute.
  struct Picture {
    Count finished;
    uint32_t first = 0, count = 0;
    Slice<const float> colour, opacity;   // [count][3], [count]
    bool standsBeforeBackgrounds = true;  // composite over PhotoRays::backgrounds; else colours include a background
    float weight = 1;                     // of the colour loss
    bool trainsExposures = true;
    bool comparesTransparent = true;  // else only the opaque pixels of photos are compared
  };
  static constexpr uint32_t kLosses = 2;  // the colour loss, and the sum of squared errors

  // Computes the losses [kLosses] and the gradients of the exposed colours. The colour loss and its gradients are means
  // over all rays and channels of the step.
  void compare(const PhotoRays& rays, const Picture& picture, Slice<float> losses);
  // Propagates the gradients to the colours (in place) and the opacity (0 without backgrounds), and adds to the
  // gradients of the exposures.
  void passBack(const PhotoRays& rays, const Picture& picture);

  Slice<const float> exposed(const Picture& picture) const { return exposed_.part(3 * at(picture), 3 * of(picture)); }
  Slice<float> colourGradients(const Picture& picture) {
    return colourGradients_.part(3 * at(picture), 3 * of(picture));
  }
  Slice<float> opacityGradients(const Picture& picture) { return opacityGradients_.part(at(picture), of(picture)); }

  PhotoExposures& exposures() { return exposures_; }

 private:
  static size_t at(const Picture& picture) { return picture.first; }
  static size_t of(const Picture& picture) { return picture.count; }
  static Slice<const float> backgrounds(const PhotoRays& rays, const Picture& picture);

  Device& device_;
  ColourLossKind kind_;
  float parameter_;
  PhotoExposures exposures_;
  Array<float> exposed_, colourGradients_, opacityGradients_;
  Array<float> unusedGradients_;  // of the exposures, from images that do not train them
};

}  // namespace tessera
