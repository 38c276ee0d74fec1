#include "train/photo_exposures.h"

#include <gtest/gtest.h>

#include <cmath>

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

// The checkpoint of exposures with these gains.
Bytes checkpoint(Device& device, const Capture& capture, const std::vector<float>& gains) {
  PhotoExposures exposures(device, capture);
  TensorSet given;
  given.add("exposures", gains);
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
      gains.push_back(static_cast<float>(0.4 * capture.photos[i].exposure));
      alternating.push_back(i % 2 == 0 ? 0.5f : -0.5f);
    }
  }
  const TemporaryFolder folder;
  const ModelFolder model(folder / "model");
  EXPECT_FALSE(readExposureResponse(model).has_value()) << "there is no model";
  model.commit({"field", 1, 2, {}}, 1, [&](uint32_t) { return checkpoint(*device, capture, gains); });
  const auto response = readExposureResponse(model);
  ASSERT_TRUE(response.has_value());
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(response->slope[c], 0.4, 1e-5);
    EXPECT_NEAR(response->offset[c], 0, 1e-5);
  }
  model.commit({"field", 2, 2, {}}, 1, [&](uint32_t) { return checkpoint(*device, capture, alternating); });
  EXPECT_FALSE(readExposureResponse(model).has_value()) << "exposures explain nothing of these";
}

}  // namespace
}  // namespace tessera
