// Compiles the decoders that are exported for Unreal Engine as a Custom node does, runs them on a Vulkan device, and
// compares them with the decoder on the CPU.
#include "export/hlsl_decoder.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "base/file.h"
#include "base/random.h"
#include "gpu/stream.h"
#include "gpu/testing/test_context.h"
#include "render/cpu/dense_network.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/testing/random_mesh.h"
#include "scene/spherical_harmonics.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

constexpr ImageSize kPixels = {400, 250};  // a sample in each: 100 000
constexpr double kTolerance = 1e-3;

// What a pixel decodes: numbers that follow from its index, the same in HLSL below.
uint32_t scramble(uint32_t value) {  // PCG (Jarzynski and Olano 2020, "Hash Functions for GPU Rendering")
  const uint32_t state = value * 747796405u + 2891336453u;
  const uint32_t word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
  return (word >> 22u) ^ word;
}
float uniformNumber(uint32_t index, uint32_t number) {
  return static_cast<float>(scramble(scramble(index) + number) >> 8) / 16777216.0f;
}

constexpr const char* kVertexShader = R"(
float4 main(uint index : SV_VertexID) : SV_Position {
  return float4(index == 1 ? 3.0 : -1.0, index == 2 ? 3.0 : -1.0, 0.5, 1.0);
}
)";

// Returns a fragment shader with a function in whose body the decoder stands, as in those that Unreal generates from
// Custom nodes.
std::string writeFragmentShader(const PatchSet& part, const Mat3d& directions) {
  const auto write = [](const auto& numberAt) {
    return fmt::format("float4({:.9g}, {:.9g}, {:.9g}, {:.9g})", numberAt(0), numberAt(1), numberAt(2), numberAt(3));
  };
  std::array<std::string, 4> ranges;  // lowA, lowB, spanA, spanB
  for (uint32_t half : {0u, 1u}) {
    const FeatureRange* const each = &part.ranges[4 * half];
    ranges[half] = write([&](uint32_t f) { return each[f].low; });
    ranges[2 + half] = write([&](uint32_t f) { return each[f].high - each[f].low; });
  }
  std::string text = R"(
uint scramble(uint value) {
  uint state = value * 747796405u + 2891336453u;
  uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
  return (word >> 22u) ^ word;
}
float uniformNumber(uint index, uint number) {
  return float(scramble(scramble(index) + number) >> 8) / 16777216.0;
}
)";
  // The variables and the statements stand as the script of the export joins them.
  text += writeHlslFunctions(part.decoder, directions) +
          "float3 custom(float4 texelsA, float4 texelsB, float3 toCamera) {\nconst float3 viewDirection = -toCamera;\n";
  const char* const names[] = {"lowA", "lowB", "spanA", "spanB"};
  for (size_t i = 0; i < 4; ++i) text += fmt::format("const float4 {} = {};\n", names[i], ranges[i]);
  text += writeHlslStatements(part.decoder, directions) + "}\n";
  return text + fmt::format(R"(
struct Colours {{
  float4 srgb : SV_Target0;
  float4 light : SV_Target1;
}};
Colours main(float4 position : SV_Position) {{
  uint index = uint(position.y) * {0}u + uint(position.x);
  float4 a = float4(uniformNumber(index, 0u), uniformNumber(index, 1u), uniformNumber(index, 2u), uniformNumber(index, 3u));
  float4 b = float4(uniformNumber(index, 4u), uniformNumber(index, 5u), uniformNumber(index, 6u), uniformNumber(index, 7u));
  float3 toCamera = 2.0 * float3(uniformNumber(index, 8u), uniformNumber(index, 9u), uniformNumber(index, 10u)) - 1.0;
  Colours colours;
  colours.srgb = float4(tesseraColour(a, b, {1}, {2}, {3}, {4}, -toCamera), 1.0);
  colours.light = float4(custom(a, b, toCamera), 1.0);
  return colours;
}}
)",
                            kPixels.width, ranges[0], ranges[1], ranges[2], ranges[3]);
}

std::vector<uint32_t> compileHlsl(const std::string& text, const std::string& stage) {
  const fs::path source = fs::temp_directory_path() / fmt::format("tessera-{}-{}.hlsl", ::getpid(), stage);
  const fs::path compiled = source.string() + ".spv";
  writeFileAtomically(source, text);
  const std::string command = fmt::format("'{}' -D -V --quiet --target-env vulkan1.2 -S {} -e main -o '{}' '{}'",
                                          TESSERA_GLSLANG, stage, compiled.string(), source.string());
  std::vector<uint32_t> words;
  if (std::system(command.c_str()) == 0) {
    const Bytes bytes = readFile(compiled);
    words.resize(bytes.size() / sizeof(uint32_t));
    std::memcpy(words.data(), bytes.data(), bytes.size());
  }
  fs::remove(source);
  fs::remove(compiled);
  return words;
}

struct DecodedColours {
  std::vector<float> srgb, light;  // [pixel][4]
};

class HlslDecoder : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
    stream_ = std::make_unique<GpuStream>(context_);
  }
  void TearDown() override {
    stream_.reset();
    EXPECT_EQ(GpuContext::validationMessages(), 0);
  }

  DecodedColours run(const PatchSet& part, const Mat3d& directions) {
    const std::vector<uint32_t> vertex = compileHlsl(kVertexShader, "vert");
    const std::vector<uint32_t> fragment = compileHlsl(writeFragmentShader(part, directions), "frag");
    if (vertex.empty() || fragment.empty()) {
      ADD_FAILURE() << "the shaders do not compile";
      return {};
    }
    const GraphicsPipelineOptions options = {
        .colours = {{.format = ImageFormat::rgba32Float}, {.format = ImageFormat::rgba32Float}}};
    pipelines_.push_back(std::make_unique<GpuGraphicsPipeline>(context_, vertex, fragment, options));
    const auto srgb = stream_->makeImage(kPixels, ImageFormat::rgba32Float),
               light = stream_->makeImage(kPixels, ImageFormat::rgba32Float);
    const GpuRenderPass pass(context_, {{.image = srgb}, {.image = light}});
    static constexpr std::array<std::byte, 4> kNoArguments{};
    stream_->draw(pass, {pipelines_.back().get(), kNoArguments, {.vertices = 3}});
    DecodedColours colours = {download(*srgb), download(*light)};
    stream_->finish();
    return colours;
  }

 private:
  std::vector<float> download(const GpuImage& image) {
    GpuBuffer buffer(context_, image.copiedBytes());
    std::vector<float> values(image.copiedBytes() / sizeof(float));
    stream_->copy(image, buffer, 0);
    stream_->download(buffer, 0, std::as_writable_bytes(std::span(values)));
    return values;
  }

  std::shared_ptr<GpuContext> context_;
  std::unique_ptr<GpuStream> stream_;
  std::vector<std::unique_ptr<GpuGraphicsPipeline>> pipelines_;
};

// The colour that section 8 of docs/tile-format.md defines.
std::array<float, 3> decodeOnCpu(const PatchSet& part, const DenseNetwork& network, uint32_t index,
                                 const Vec3d& directionInScene) {
  alignas(64) std::array<float, DenseNetwork::kMaxWidth> values{};
  for (uint32_t f = 0; f < kMeshFeatures; ++f) values[f] = part.ranges[f].decode(255 * uniformNumber(index, f));
  const std::array<float, 16> harmonics = evaluateHarmonics(directionInScene.normalized());
  std::copy_n(harmonics.begin(), kMeshHarmonics, values.begin() + kMeshFeatures);
  network.run(values.data());
  std::array<float, 3> colour{};
  for (size_t c = 0; c < 3; ++c) colour[c] = 1 / (1 + std::exp(-values[c]));
  return colour;
}

double toLinear(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

// Returns the largest difference between the device and the CPU. `sceneFromUnreal`: of directions.
double largestDifference(const DecodedColours& colours, const PatchSet& part, const Mat3d& sceneFromUnreal) {
  const DenseNetwork network(part.decoder, kMeshFeatures + kMeshHarmonics, 3);
  double largest = 0;
  for (uint32_t index = 0; index < kPixels.width * kPixels.height; ++index) {
    Vec3d inUnreal;
    for (uint32_t axis = 0; axis < 3; ++axis) inUnreal[axis] = -(2.0 * double{uniformNumber(index, 8 + axis)} - 1);
    const std::array<float, 3> expected = decodeOnCpu(part, network, index, sceneFromUnreal * inUnreal);
    for (size_t c = 0; c < 3; ++c) {
      largest = std::max(largest, std::abs(double{colours.srgb[4 * index + c]} - double{expected[c]}));
      largest = std::max(largest, std::abs(double{colours.light[4 * index + c]} - toLinear(double{expected[c]})));
    }
  }
  return largest;
}

TEST_F(HlslDecoder, ReturnsTheColoursOfTheCpuForAllPartsOfAScene) {
  const Tileset tileset = readTileset(TESSERA_GOLDEN_MESH);
  const Mat3d directions = sceneFromUnreal(tileset.tileFromScene());
  double largest = 0;
  int parts = 0;
  for (const Tile& tile : tileset.tiles) {
    for (const TileContent& declared : tile.contents) {
      const auto content = readContent(contentPath(TESSERA_GOLDEN_MESH, declared.uri), meshCodec());
      for (const PatchSet& part : contentAs<MeshContent>(*content).parts) {
        const DecodedColours colours = run(part, directions);
        ASSERT_EQ(colours.srgb.size(), size_t{4} * kPixels.width * kPixels.height);
        largest = std::max(largest, largestDifference(colours, part, directions));
        ++parts;
      }
    }
  }
  EXPECT_GT(parts, 1);
  EXPECT_LE(largest, kTolerance);
  RecordProperty("largest_difference", fmt::format("{:.3g}", largest));
}

TEST_F(HlslDecoder, AcceptsLayersWhoseWidthsAreNoMultiplesOfFour) {
  PatchSet part = tiles_test::randomPatchSet(5);
  const RandomStream random(5, 0x686c);
  uint64_t next = 0;
  part.decoder.clear();
  for (const auto& [inputs, outputs] : {std::pair{17u, 13u}, {13u, 7u}, {7u, 3u}}) {
    DenseLayer layer{inputs, outputs, {}, {}};
    for (uint32_t i = 0; i < inputs * outputs; ++i) layer.weights.push_back(2 * random.uniform(next++) - 1);
    for (uint32_t i = 0; i < outputs; ++i) layer.biases.push_back(static_cast<float>(i % 3) - 1);
    part.decoder.push_back(layer);
  }
  const Mat3d directions = sceneFromUnreal(Similarity());
  const DecodedColours colours = run(part, directions);
  ASSERT_FALSE(colours.srgb.empty());
  EXPECT_LE(largestDifference(colours, part, directions), kTolerance);
}

TEST_F(HlslDecoder, DependsOnTheHandednessOfTheAxes) {
  const PatchSet part = tiles_test::randomPatchSet(6);
  const Mat3d directions = sceneFromUnreal(Similarity());
  const DecodedColours colours = run(part, directions);
  ASSERT_FALSE(colours.srgb.empty());
  EXPECT_LE(largestDifference(colours, part, directions), kTolerance);
  EXPECT_GT(largestDifference(colours, part, Mat3d::Identity()), 50 * kTolerance)
      << "odd harmonics have the other sign";
}

}  // namespace
}  // namespace tessera
