#include "train/photo_loss.h"

#include "compute/exposure.h"
#include "train/colour_loss.h"

namespace tessera {

PhotoLoss::PhotoLoss(Device& device, const Capture& capture, const PhotoLossSettings& settings, uint32_t maxRays)
    : device_(device),
      kind_(colourLossKind(settings.loss)),
      parameter_(static_cast<float>(settings.lossParameter)),
      exposures_(device, capture) {
  for (Array<float>* three : {&exposed_, &colourGradients_}) *three = device.array<float>(size_t{3} * maxRays);
  opacityGradients_ = device.array<float>(maxRays);
}

Slice<const float> PhotoLoss::backgrounds(const PhotoRays& rays, const Picture& picture) {
  return picture.standsBeforeBackgrounds ? rays.backgrounds(picture.first, picture.count) : Slice<const float>();
}

void PhotoLoss::compare(const PhotoRays& rays, const Picture& picture, Slice<float> losses) {
  device_.run(ExposureForward{picture.finished, picture.colour, picture.opacity, backgrounds(rays, picture),
                              rays.photoOfRay(picture.first, picture.count), exposures_.logGains(),
                              exposed_.part(3 * at(picture), 3 * of(picture))});
  ColourLoss loss;
  loss.kind = kind_;
  loss.parameter = parameter_;
  loss.scale = picture.weight / (3.0f * static_cast<float>(rays.count()));
  loss.rays = picture.finished;
  loss.predicted = exposed(picture);
  loss.target = rays.targets(picture.first, picture.count);
  loss.weights = picture.comparesTransparent ? rays.weights(picture.first, picture.count)
                                             : rays.opaqueWeights(picture.first, picture.count);
  loss.loss = losses;
  loss.gradients = colourGradients(picture);
  device_.run(loss);
}

void PhotoLoss::passBack(const PhotoRays& rays, const Picture& picture) {
  const Slice<float> gradients = colourGradients(picture);
  if (!picture.standsBeforeBackgrounds) device_.fillZero(opacityGradients(picture));
  if (!picture.trainsExposures && unusedGradients_.size() == 0)
    unusedGradients_ = device_.array<float>(exposures_.gradients().count);
  device_.run(ExposureBackward{picture.finished, picture.colour, backgrounds(rays, picture),
                               rays.photoOfRay(picture.first, picture.count), exposures_.logGains(), gradients,
                               gradients, opacityGradients(picture),
                               picture.trainsExposures ? exposures_.gradients() : unusedGradients_.all()});
}

}  // namespace tessera
