#include "train/photo_exposures.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "compute/device.h"

namespace tessera {
namespace {

// Sixteen photos of different exposures, all trained on.
Capture exposedPhotos() {
  Capture capture;
  for (int i = 0; i < 16; ++i) {
    Photo photo;
    photo.exposure = 0.1 * (i - 8) + 0.03;
    capture.photos.push_back(photo);
  }
  return capture;
}

// The checkpoint of exposures with these gains, after so many steps of each.
Bytes checkpoint(Device& device, const Capture& capture, const std::vector<float>& gains,
                 const std::vector<uint32_t>& counts) {
  PhotoExposures exposures(device, capture);
  TensorSet given;
  given.add("exposures", gains);
  given.add("exposures.m1", std::vector<float>(gains.size()));
  given.add("exposures.m2", std::vector<float>(gains.size()));
  given.add("exposures.count", counts);
  exposures.restore("given", *decodeSafetensors(given.encode({})));
  TensorSet saved;
  exposures.save(saved);
  return saved.encode({});
}

TEST(PhotoExposures, SaveTheResponseToExposuresThatExplainsThem) {
  const std::unique_ptr<Device> device = makeDevice({"reference", 0});
  const Capture capture = exposedPhotos();
  std::vector<float> gains, alternating;
  for (size_t i = 0; i < capture.photos.size(); ++i) {
    for (int channel = 0; channel < 3; ++channel) {
      gains.push_back(static_cast<float>(0.4 * *capture.photos[i].exposure));
      alternating.push_back(i % 2 == 0 ? 0.5f : -0.5f);
    }
  }
  const std::vector<uint32_t> trained(gains.size(), 1);
  const TemporaryFolder folder;
  const ModelFolder model(folder / "model");
  EXPECT_FALSE(readExposureResponse(model).has_value()) << "there is no model";
  model.commit({"field", 1, 2, {}}, 1, [&](uint32_t) { return checkpoint(*device, capture, gains, trained); });
  const auto response = readExposureResponse(model);
  ASSERT_TRUE(response.has_value());
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(response->slope[c], 0.4, 1e-5);
    EXPECT_NEAR(response->offset[c], 0, 1e-5);
  }
  model.commit({"field", 2, 2, {}}, 1, [&](uint32_t) { return checkpoint(*device, capture, alternating, trained); });
  EXPECT_FALSE(readExposureResponse(model).has_value()) << "exposures explain nothing of these";
}

// Such as photos outside of the blocks that are trained.
TEST(PhotoExposures, LeaveOutPhotosWithoutRays) {
  const std::unique_ptr<Device> device = makeDevice({"reference", 0});
  const Capture capture = exposedPhotos();
  std::vector<float> gains(3 * capture.photos.size());
  std::vector<uint32_t> counts(gains.size());
  for (size_t i = 0; i < 10; ++i) {
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      gains[c] = static_cast<float>(0.4 * *capture.photos[i].exposure + 0.5);
      counts[c] = 7;
    }
  }
  const TemporaryFolder folder;
  const ModelFolder model(folder / "model");
  model.commit({"field", 1, 2, {}}, 1, [&](uint32_t) { return checkpoint(*device, capture, gains, counts); });
  const auto response = readExposureResponse(model);
  ASSERT_TRUE(response.has_value());
  EXPECT_NEAR(response->slope[1], 0.4, 1e-5);
  EXPECT_NEAR(response->offset[1], 0.5, 1e-5);

  PhotoExposures exposures(*device, capture);
  exposures.hold(model);
  exposures.centre();
  const std::vector<float> centred = device->read(exposures.logGains());
  double sum = 0;
  for (size_t i = 0; i < 10; ++i) sum += centred[3 * i];
  EXPECT_NEAR(sum, 0, 1e-5);
  EXPECT_NEAR(centred[0] - centred[3], -0.04, 1e-5);
  for (size_t i = 30; i < centred.size(); ++i) EXPECT_EQ(centred[i], 0) << i;
}

TEST(PhotoExposures, OfAnotherModelAreHeld) {
  const std::unique_ptr<Device> device = makeDevice({"reference", 0});
  const Capture capture = exposedPhotos();
  const TemporaryFolder folder;
  const ModelFolder model(folder / "model");
  PhotoExposures exposures(*device, capture);
  EXPECT_THROW(exposures.hold(model), Error);
  const std::vector<float> gains(3 * capture.photos.size(), 0.25f);
  model.commit({"field", 1, 2, {}}, 1,
               [&](uint32_t) { return checkpoint(*device, capture, gains, std::vector<uint32_t>(gains.size(), 1)); });
  exposures.hold(model);
  const std::vector<float> gradients(gains.size(), 1.0f);
  device->write(exposures.gradients(), std::span<const float>(gradients));
  exposures.step({}, true);
  exposures.settle(15, true);
  EXPECT_EQ(device->read(exposures.logGains()), gains);
  TensorSet ofThisLevel;
  ofThisLevel.add("exposures", std::vector<float>(gains.size(), 0.5f));
  exposures.restore("checkpoint", *decodeSafetensors(ofThisLevel.encode({})));
  EXPECT_EQ(device->read(exposures.logGains()), gains);
  EXPECT_EQ(device->read(Slice<const float>(exposures.gradients())), std::vector<float>(gains.size(), 0.0f));
}

// A black photo, which no gain explains.
TEST(PhotoExposures, StayWithinThreeStops) {
  const std::unique_ptr<Device> device = makeDevice({"reference", 0});
  const Capture capture = exposedPhotos();
  PhotoExposures exposures(*device, capture);
  std::vector<float> gradients(3 * capture.photos.size());
  gradients[0] = 1;
  Adam adam;
  adam.rate = 0.5f;
  adam.skipZeroGradients = true;
  for (int step = 0; step < 30; ++step) {
    device->write(exposures.gradients(), std::span<const float>(gradients));
    exposures.step(adam, true);
  }
  EXPECT_EQ(device->read(exposures.logGains())[0], -3);
}

}  // namespace
}  // namespace tessera
