// How far what rays see is off from what photos show: exposure → colour loss, and back through the exposure.
//
//   loss.compare(photoRays, picture, losses);
//   ... what else is lost by the exposed colours, added to loss.colourGradients()
//   loss.passBack(photoRays, picture);
#pragma once

#include "compute/losses.h"
#include "train/photo_exposures.h"
#include "train/photo_rays.h"
#include "train/settings/losses.h"

namespace tessera {

class PhotoLoss {
 public:
  // Throws Error when there is no such loss. Keeps a reference to `device`.
  PhotoLoss(Device& device, const Capture& capture, const PhotoLossSettings& settings, uint32_t mostRays);

  // What rays [first, first + count) of the step see, of which `finished` count.
  struct Picture {
    Count finished;
    uint32_t first = 0, count = 0;
    Slice<const float> colour, opacity;   // [count][3], [count]
    bool standsBeforeBackgrounds = true;  // else its colours are whole
  };
  static constexpr uint32_t kLosses = 2;  // colour loss, and the sum of squared errors

  // Losses [kLosses] and gradients of the exposed colours, divided by all rays of the step.
  void compare(const PhotoRays& rays, const Picture& picture, Slice<float> losses);
  // Turns them into gradients of the colours and the opacity (0 where colours are whole), and adds to the exposures'.
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
};

}  // namespace tessera
