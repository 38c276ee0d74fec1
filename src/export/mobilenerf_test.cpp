#include "export/mobilenerf.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/error.h"
#include "base/image_io.h"
#include "base/random.h"
#include "export/mesh_level.h"
#include "representations/mesh/content/infer_maps.h"
#include "scene/spherical_harmonics.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

const fs::path kViewedScene = TESSERA_GOLDEN_MESH;

// What a program reads from the files of a shape.
struct ReadShape {
  std::vector<Vec3d> positions;
  std::vector<std::array<double, 2>> places;  // of the texture, v upwards
  std::vector<std::array<size_t, 3>> faces;   // indices of both
  std::array<ImageU8, 2> textures;

  ReadShape(const fs::path& folder, size_t number) {
    const std::string name = "shape" + std::to_string(number);
    std::ifstream file(folder / (name + ".obj"));
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      std::string kind;
      words >> kind;
      if (kind == "v") {
        Vec3d& at = positions.emplace_back();
        words >> at[0] >> at[1] >> at[2];
      } else if (kind == "vt") {
        auto& at = places.emplace_back();
        words >> at[0] >> at[1];
      } else {
        EXPECT_EQ(kind, "f");
        auto& face = faces.emplace_back();
        for (size_t& corner : face) {
          char slash = 0;
          size_t place = 0;
          words >> corner >> slash >> place;
          EXPECT_EQ(corner, place);
          --corner;
        }
      }
    }
    for (size_t i = 0; i < 2; ++i)
      textures[i] = readImage(folder / (name + ".pngfeat" + std::to_string(i) + ".png")).image;
  }

  // The texel that the viewer shows at a place.
  std::array<int, 2> texelAt(const std::array<double, 2>& place) const {
    return {static_cast<int>(std::floor(place[0] * textures[0].width)),
            static_cast<int>(std::floor((1 - place[1]) * textures[0].height))};
  }
};

// The colour that the viewer computes of eight bytes and a direction in its own axes.
std::array<double, 3> viewedColour(const nlohmann::json& network, const std::array<uint8_t, 8>& bytes,
                                   const Vec3d& direction) {
  std::vector<double> values;
  for (size_t i = 0; i < 8; ++i) values.push_back(i % 4 == 3 ? bytes[i] / 255.0 * 2 - 1 : bytes[i] / 255.0);
  values.insert(values.end(), {direction.x(), -direction.z(), direction.y()});
  for (const std::string layer : {"0", "1", "2"}) {
    std::vector<double> sums = network[layer + "_bias"].get<std::vector<double>>();
    const auto rows = network[layer + "_weights"].get<std::vector<std::vector<double>>>();
    EXPECT_EQ(rows.size(), values.size());
    for (size_t input = 0; input < rows.size(); ++input)
      for (size_t output = 0; output < sums.size(); ++output) sums[output] += values[input] * rows[input][output];
    for (double& sum : sums) sum = layer == "2" ? 1 / (1 + std::exp(-sum)) : std::max(0.0, sum);
    values = sums;
  }
  EXPECT_EQ(values.size(), 3u);
  return {values[0], values[1], values[2]};
}

// The colour that the scene has there.
std::array<double, 3> sceneColour(const std::vector<DenseLayer>& decoder, const MeshTexel& texel,
                                  const Vec3d& direction) {
  std::vector<double> values(texel.features.begin(), texel.features.end());
  const auto harmonics = evaluateHarmonics(direction);
  values.insert(values.end(), harmonics.begin(), harmonics.begin() + kMeshHarmonics);
  for (size_t i = 0; i < decoder.size(); ++i) {
    std::vector<double> sums(decoder[i].biases.begin(), decoder[i].biases.end());
    for (size_t output = 0; output < sums.size(); ++output)
      for (size_t input = 0; input < values.size(); ++input)
        sums[output] += double{decoder[i].weights[output * values.size() + input]} * values[input];
    if (i + 1 < decoder.size())
      for (double& sum : sums) sum = std::max(0.0, sum);
    values = sums;
  }
  return {1 / (1 + std::exp(-values[0])), 1 / (1 + std::exp(-values[1])), 1 / (1 + std::exp(-values[2]))};
}

class MobilenerfExportTest : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-mobilenerf-" + std::to_string(::getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  void exportScene(uint32_t level, int steps, int threads = 0) {
    exported_ = exportMobilenerf(kViewedScene, out(), {.level = level, .refitSteps = steps, .threads = threads});
    network_ = nlohmann::json::parse(readTextFile(out() / "mlp.json"));
  }
  fs::path out() const { return root_ / "golden_phone"; }

  // Calls use(shape, part) for each part of a level with its shape.
  template <class Use>
  void forEachShape(uint32_t level, const Use& use) const {
    const MeshLevel contents(kViewedScene, level, "mobilenerf");
    size_t number = 0;
    for (const LevelContent& listed : contents.contents()) {
      MeshContent mesh = contentAs<MeshContent>(*contents.read(listed));
      inferMapsOnCpu(mesh, 1);
      for (const PatchSet& part : mesh.parts)
        if (part.patches > 0) use(ReadShape(out(), number++), part);
    }
    EXPECT_EQ(number, exported_.shapes);
    EXPECT_EQ(network_["obj_num"], number);
  }

  fs::path root_;
  MobilenerfExport exported_;
  nlohmann::json network_;
};

TEST_F(MobilenerfExportTest, PlacesTrianglesAndTheirTexels) {
  const Similarity viewer = viewerFromScene(readTileset(kViewedScene));
  EXPECT_NEAR((viewer.rotation * Vec3d(1, 2, 3) - Vec3d(1, 3, -2)).norm(), 0, 1e-12) << "y is up, -z is north";
  for (const uint32_t level : {0u, 1u}) {
    exportScene(level, 1);
    uint64_t triangles = 0;
    forEachShape(level, [&](const ReadShape& shape, const PatchSet& part) {
      ASSERT_EQ(shape.faces.size(), part.triangles());
      triangles += part.triangles();
      size_t face = 0;
      for (uint32_t patch = 0; patch < part.patches; ++patch) {
        const int left = static_cast<int>(patch % part.patchesAcross() * part.patchEdge),
                  top = static_cast<int>(patch / part.patchesAcross() * part.patchEdge),
                  last = static_cast<int>(part.patchEdge) - 1;
        const auto expectFace = [&](const std::array<uint32_t, 3>& corners) {
          for (size_t i = 0; i < 3; ++i) {
            const size_t index = shape.faces[face][i];
            const Vec3d expected = viewer * part.corner(patch, corners[i]);
            ASSERT_LT((shape.positions[index] - expected).norm(), 1e-6 * (1 + expected.norm()));
            const std::array<int, 2> texel = {left + (corners[i] % 2 == 1 ? last : 0),
                                              top + (corners[i] / 2 == 1 ? last : 0)};
            ASSERT_EQ(shape.texelAt(shape.places[index]), texel);
            const double middle = shape.places[index][0] * shape.textures[0].width - texel[0];
            ASSERT_NEAR(middle, 0.5, 0.01) << "at the middle of a texel";
          }
          ++face;
        };
        expectFace({0, 1, 2});
        if (patch < part.pairs) expectFace({3, 2, 1});
      }
    });
    EXPECT_EQ(exported_.triangles, triangles);
  }
}

TEST_F(MobilenerfExportTest, ListsAllFilesAndTheirBytes) {
  exportScene(1, 1);
  uint64_t bytes = 0, files = 0;
  for (const auto& entry : fs::directory_iterator(out())) {
    bytes += entry.file_size();
    ++files;
  }
  EXPECT_EQ(exported_.bytesOnDisk, bytes);
  EXPECT_EQ(files, 3 * exported_.shapes + 1) << "those of the earlier export are gone";
}

TEST_F(MobilenerfExportTest, ShowsTheColoursOfTheSceneWhereItIsOpaque) {
  exportScene(0, 600);
  EXPECT_EQ(network_["0_weights"].size(), kViewerInputs);
  EXPECT_GT(exported_.refit.psnr, 30) << "with " << exported_.refit.colours << " colours";
  double squares = 0;
  size_t count = 0, transparent = 0;
  uint64_t next = 0;
  forEachShape(0, [&](const ReadShape& shape, const PatchSet& part) {
    const RandomStream random(1, 2);
    for (uint32_t patch = 0; patch < part.patches; ++patch) {
      for (uint32_t i = 0; i < 4; ++i) {
        const uint32_t column = random.below(next++, part.patchEdge), row = random.below(next++, part.patchEdge);
        const int x = static_cast<int>(patch % part.patchesAcross() * part.patchEdge + column),
                  y = static_cast<int>(patch / part.patchesAcross() * part.patchEdge + row);
        std::array<uint8_t, 8> bytes{};
        for (size_t f = 0; f < 8; ++f) bytes[f] = shape.textures[f / 4].at(x, y)[f % 4];
        EXPECT_GE(std::min(bytes[3], bytes[7]), 128) << "the upper half of alpha";
        const MeshTexel texel = mixTexels(part, patch, static_cast<float>(column), static_cast<float>(row));
        ASSERT_EQ(bytes[0] == 0, texel.opacity < 0.5f) << "transparent where red is 0";
        if (bytes[0] == 0) {
          ++transparent;
          continue;
        }
        const double z = -0.3 - 0.7 * random.uniformDouble(next++), turn = 6.28 * random.uniformDouble(next++);
        const Vec3d direction(std::sqrt(1 - z * z) * std::cos(turn), std::sqrt(1 - z * z) * std::sin(turn), z);
        const auto scene = sceneColour(part.decoder, texel, direction);
        const auto viewed =
            viewedColour(network_, bytes, viewerFromScene(readTileset(kViewedScene)).rotation * direction);
        for (size_t c = 0; c < 3; ++c) squares += std::pow(scene[c] - viewed[c], 2) / 3;
        ++count;
      }
    }
  });
  EXPECT_GT(transparent, 0u);
  ASSERT_GT(count, 100u);
  const double rms = std::sqrt(squares / static_cast<double>(count));
  EXPECT_LT(rms, 1.5 * exported_.refit.rms) << "as large as the export says";
  EXPECT_GT(rms, exported_.refit.rms / 1.5);
}

TEST_F(MobilenerfExportTest, FitsTheNetworkBetterTheLongerItIsTrained) {
  exportScene(1, 1);
  const double atFirst = exported_.refit.rms;
  exportScene(1, 500);
  EXPECT_LT(exported_.refit.rms, atFirst / 3);
}

TEST_F(MobilenerfExportTest, WritesTheSameBytesWithAnyNumberOfThreads) {
  exportScene(1, 20, 1);
  const std::string one = readTextFile(out() / "mlp.json"), texture = readTextFile(out() / "shape0.pngfeat1.png");
  exportScene(1, 20, 2);
  EXPECT_EQ(readTextFile(out() / "mlp.json"), one);
  EXPECT_EQ(readTextFile(out() / "shape0.pngfeat1.png"), texture);
}

TEST(MobilenerfFeatures, AreReadAsTheNearestOfTheirNumbers) {
  for (uint32_t feature = 0; feature < kViewerFeatures; ++feature) {
    const float step = feature % 4 == 3 ? 2.0f / 255 : 1.0f / 255;
    for (float value = step; value <= 1; value += 0.003f)
      EXPECT_NEAR(decodeViewerFeature(feature, encodeViewerFeature(feature, value)), value, step / 2 + 1e-6f)
          << feature;
    EXPECT_EQ(encodeViewerFeature(feature, 1), 255);
    EXPECT_EQ(encodeViewerFeature(feature, 0), feature == 0 ? 1 : feature % 4 == 3 ? 128 : 0);
  }
}

TEST_F(MobilenerfExportTest, RefusesWhatItCannotExportAndWritesNothing) {
  const auto refusal = [&](const fs::path& scene, const fs::path& to, uint32_t level) -> std::string {
    try {
      exportMobilenerf(scene, to, {.level = level, .refitSteps = 1});
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_NE(refusal(TESSERA_GOLDEN_VOLUME, out(), 0).find("--format mobilenerf"), std::string::npos);
  EXPECT_NE(refusal(kViewedScene, out(), 2).find("the scene has levels 0 to 1"), std::string::npos);
  EXPECT_NE(refusal(kViewedScene, root_ / "golden", 0).find("ends in _phone"), std::string::npos);
  EXPECT_TRUE(fs::is_empty(root_));
}

}  // namespace
}  // namespace tessera
