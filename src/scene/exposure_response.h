// How the brightness that a photo was trained with follows from the light that it collected, as its EXIF tells: the
// gains that training fits to each photo, as a linear function of Photo::exposure. Photos store colours in sRGB, where
// a stop is less than a factor of two, and cameras follow the light: the slope is fitted.
#pragma once

#include <array>
#include <optional>
#include <span>

namespace tessera {

// The predicted log2 gain of a channel is offset + slope · Photo::exposure.
struct ExposureResponse {
  std::array<float, 3> slope{}, offset{};

  // The factors for the colours of a photo, by channel. They are 1 if its exposure is not known.
  std::array<double, 3> gain(std::optional<double> exposure) const;
  bool operator==(const ExposureResponse&) const = default;
};

// Fits the response to the log2 gains [photos][3] of the photos `trained`. `exposures`: Photo::exposure of each photo.
// Returns nothing if the exposures of fewer than eight of them are known, if these hardly differ, or if they explain
// less than half of the variance of the gains, or with a slope that light does not have: then something else, such as
// clouds, has changed the light.
std::optional<ExposureResponse> fitExposureResponse(std::span<const std::optional<double>> exposures,
                                                    std::span<const int> trained, std::span<const float> logGains);

}  // namespace tessera
