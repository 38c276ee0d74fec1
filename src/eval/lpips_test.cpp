#include "eval/lpips.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <map>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/image_io.h"
#include "base/random.h"
#include "base/testing/shared_data.h"

namespace tessera {
namespace {

FeatureMap noiseMap(int width, int height, int channels) {
  FeatureMap map(width, height, channels);
  const RandomStream random(8, 1);
  for (size_t i = 0; i < map.values.size(); ++i) map.values[i] = random.uniform(i) - 0.5f;
  return map;
}

float valueAt(const FeatureMap& map, int x, int y, int c) {
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return 0;
  return map.values[(static_cast<size_t>(y) * map.width + x) * map.channels + c];
}

TEST(FeatureNetwork, ConvolvesAccordingToTheDefinition) {
  ThreadPool pool(2);
  const FeatureMap input = noiseMap(13, 9, 3);
  Convolution layer{3, 4, 5, 2, 2, Eigen::MatrixXf(4, 75), Eigen::VectorXf(4)};
  const RandomStream random(8, 2);
  for (int i = 0; i < 300; ++i) layer.weights.data()[i] = random.uniform(static_cast<uint64_t>(i)) - 0.5f;
  layer.bias << 0.1f, -0.2f, 0.3f, 0.0f;
  const FeatureMap output = layer(input, pool);
  ASSERT_EQ(output.width, 7);
  ASSERT_EQ(output.height, 5);
  int positive = 0;
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) {
      for (int o = 0; o < 4; ++o) {
        double sum = layer.bias(o);
        for (int ky = 0; ky < 5; ++ky) {
          for (int kx = 0; kx < 5; ++kx) {
            for (int i = 0; i < 3; ++i) {
              sum += layer.weights(o, (ky * 5 + kx) * 3 + i) * valueAt(input, 2 * x + kx - 2, 2 * y + ky - 2, i);
            }
          }
        }
        EXPECT_NEAR(valueAt(output, x, y, o), std::max(sum, 0.0), 1e-5);
        positive += sum > 0;
      }
    }
  }
  EXPECT_GT(positive, 20);
}

TEST(FeatureNetwork, PoolsWithAndWithoutThePartialLastWindow) {
  FeatureMap row(4, 3, 1);
  for (int i = 0; i < 12; ++i) row.values[static_cast<size_t>(i)] = static_cast<float>(i % 4) - 5;
  EXPECT_EQ(maxPool(row, false).values, (std::vector<float>{-3}));
  EXPECT_EQ(maxPool(row, true).values, (std::vector<float>{-3, -2}));
  EXPECT_EQ(maxPool(FeatureMap(5, 5, 2), true).width, 2);
}

class LpipsReference : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    SKIP_WITHOUT_SHARED_DATA("lpips");
    folder_ = sharedData("lpips");
  }

  fs::path folder_;
};

TEST_P(LpipsReference, AgreesWithAnIndependentImplementationInTotalAndInEachLayer) {
  const Lpips lpips(folder_ / (GetParam() + ".safetensors"));
  EXPECT_EQ(lpips.net(), GetParam());
  ThreadPool pool(2);
  std::map<std::string, ImageF> pictures;
  for (const char* name : {"a.png", "b.png", "c.png"}) pictures[name] = toFloat(readImage(folder_ / name).image);
  int compared = 0;
  for (const auto& row : nlohmann::json::parse(readTextFile(folder_ / "reference.json"))) {
    if (row["net"] != GetParam()) continue;
    const LpipsDistance distance =
        lpips(pictures.at(row["a"].get<std::string>()), pictures.at(row["b"].get<std::string>()), pool);
    EXPECT_NEAR(distance.total, row["lpips"].get<double>(), 1e-4) << row["a"] << row["b"];
    const auto layers = row["layers"].get<std::vector<double>>();
    ASSERT_EQ(distance.layers.size(), layers.size());
    for (size_t i = 0; i < layers.size(); ++i) EXPECT_NEAR(distance.layers[i], layers[i], 1e-5) << i;
    ++compared;
  }
  EXPECT_EQ(compared, 3);
}

TEST_P(LpipsReference, AcceptsImagesOfItsSmallestSide) {
  const Lpips lpips(folder_ / (GetParam() + ".safetensors"));
  ThreadPool pool(1);
  const int side = lpips.smallestSide();
  EXPECT_GT(lpips(ImageF(side, side, 3, 0.2f), ImageF(side, side, 3, 0.9f), pool).total, 0.0);
}

INSTANTIATE_TEST_SUITE_P(Nets, LpipsReference, testing::Values("alex", "squeeze"),
                         [](const auto& instance) { return instance.param; });

TEST(Lpips, RejectsFilesThatAreNotItsWeights) {
  const fs::path path = fs::temp_directory_path() / ("tessera_lpips_" + std::to_string(::getpid()));
  writeFileAtomically(path, encodeSafetensors({}, {{"net", "vgg"}}));
  EXPECT_THROW(Lpips{path}, Error);
  writeFileAtomically(path, encodeSafetensors({}, {{"net", "alex"}}));
  EXPECT_THROW(Lpips{path}, Error);
  const std::vector<float> values(64 * 3 * 3 * 3);
  const TensorView thin{TensorType::f32, {64, 1, 3, 9}, std::as_bytes(std::span(values))};
  const TensorView bias{TensorType::f32, {64}, std::as_bytes(std::span(values).first(64))};
  writeFileAtomically(path, encodeSafetensors({{"features.0.weight", thin}, {"features.0.bias", bias}}));
  try {
    Lpips{path};
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.place(), "features.0");
  }
  fs::remove(path);
}

}  // namespace
}  // namespace tessera
